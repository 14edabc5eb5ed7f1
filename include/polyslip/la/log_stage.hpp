// A PETSc log stage (-log_view) that lasts until the end of the scope and adds its seconds to a counter.
#pragma once

#include <petsctime.h>

#include "polyslip/la/handle.hpp"

namespace polyslip::la {

class LogStage {
 public:
  LogStage(const char* name, double& seconds) : seconds_(seconds) {
    PetscLogStage stage = -1;
    (void)PetscLogStageGetId(name, &stage);
    if (stage < 0) (void)PetscLogStageRegister(name, &stage);
    (void)PetscLogStagePush(stage);
    (void)PetscTime(&start_);
  }
  ~LogStage() {
    PetscLogDouble now = 0;
    (void)PetscTime(&now);
    (void)PetscLogStagePop();
    seconds_ += now - start_;
  }
  LogStage(const LogStage&) = delete;
  LogStage& operator=(const LogStage&) = delete;

 private:
  double& seconds_;
  PetscLogDouble start_ = 0;
};

}  // namespace polyslip::la
