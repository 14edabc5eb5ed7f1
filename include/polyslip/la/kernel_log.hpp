// What the loops of assembly spend: the three kernels of a field (rock, flow) as PETSc log events, so that -log_view gives their Mflop/s,
// and as totals of this rank.
#pragma once

#include <array>
#include <ctime>
#include <string>

#include "polyslip/la/handle.hpp"

namespace polyslip::la {

enum class Kernel { geometry, local_matrices, insertion };
inline constexpr std::array<const char*, 3> kernel_names{"geometry", "local_matrices", "insertion"};  ///< By Kernel.

struct KernelWork {
  double seconds = 0;  ///< Of the processor: a rank that has to wait for it, or for others, does not work.
  double flops = 0;    ///< Additions, multiplications, divisions and roots.
  double bytes = 0;    ///< What has to pass between memory and a cache that is large enough: each array once.
};

class KernelLog {
 public:
  explicit KernelLog(const std::string& field) : field_(field) {
    for (std::size_t k = 0; k < kernel_names.size(); ++k) {
      const std::string name = field + " " + kernel_names[k];
      (void)PetscLogEventGetId(name.c_str(), &events_[k]);
      if (events_[k] < 0) (void)PetscLogEventRegister(name.c_str(), MAT_CLASSID, &events_[k]);
    }
  }

  [[nodiscard]] const std::string& field() const { return field_; }
  [[nodiscard]] const std::array<KernelWork, 3>& work() const { return work_; }
  void add_bytes(Kernel kernel, double bytes) { work_[static_cast<std::size_t>(kernel)].bytes += bytes; }

 private:
  friend class KernelScope;
  std::string field_;
  std::array<PetscLogEvent, 3> events_{-1, -1, -1};
  std::array<KernelWork, 3> work_;
};

/// A kernel at work, until the end of the scope.
class KernelScope {
 public:
  KernelScope(KernelLog& log, Kernel kernel)
      : event_(log.events_[static_cast<std::size_t>(kernel)]), work_(log.work_[static_cast<std::size_t>(kernel)]) {
    (void)PetscLogEventBegin(event_, 0, 0, 0, 0);
    begin_ = processor_seconds();
  }
  ~KernelScope() {
    work_.seconds += processor_seconds() - begin_;
    work_.flops += flops_;
    (void)PetscLogFlops(flops_);
    (void)PetscLogEventEnd(event_, 0, 0, 0, 0);
  }
  KernelScope(const KernelScope&) = delete;
  KernelScope& operator=(const KernelScope&) = delete;
  void add_flops(double flops) { flops_ += flops; }

 private:
  static double processor_seconds() {
    timespec now{};
    (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
  }
  PetscLogEvent event_;
  KernelWork& work_;
  double begin_ = 0, flops_ = 0;
};

}  // namespace polyslip::la
