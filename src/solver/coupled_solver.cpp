#include "polyslip/solver/coupled_solver.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "polyslip/la/field_split.hpp"
#include "polyslip/la/options.hpp"
#include "polyslip/la/reuse.hpp"
#include "polyslip/la/vec_access.hpp"
#include "polyslip/solver/condensed_operator.hpp"
#include "polyslip/solver/pressure_multigrid.hpp"

namespace polyslip::solver {

using assembly::CoupledSystem;
using assembly::MechanicsSystem;
using physics::ContactState;

namespace {

constexpr const char *prefix = "coupled_", *memory_remedy = "-coupled_pc_type fieldsplit";
/// Unknowns up to which a factorisation is the faster choice: in 2D without fractures, where steps of equal length share it; with fractures,
/// where it is made in almost each iteration and multigrid serves well; and otherwise.
constexpr GlobalIndex direct_limit_2d = 300'000, direct_limit = 15'000, direct_limit_fractured = 4'000;

}  // namespace

CoupledSolver::CoupledSolver(CoupledSystem& system)
    : DirectionSolver(system, system.create_condensed_vector()),
      system_(system),
      exact_operator_(condensed_operator(system, system.layout().displacement_size() + system.flow().layout().size())),
      hierarchy_(system) {
  choose();
}

void CoupledSolver::choose() {
  const int dim = system_.layout().dim();
  PetscInt unknowns = 0;
  POLYSLIP_PETSC(VecGetSize(rhs_, &unknowns));
  const bool fractured = system_.fracture_faces() > 0;
  const GlobalIndex limit = fractured && suits_multigrid(system_) ? direct_limit_fractured : dim == 2 && !fractured ? direct_limit_2d : direct_limit;
  const bool direct = unknowns <= limit;
  const std::string scene = fmt::format("{} unknowns in {}D{}", unknowns, dim, fractured ? " with fractures" : "");
  PC pc = nullptr;
  POLYSLIP_PETSC(KSPCreate(system_.mesh().comm, ksp_.put()));
  POLYSLIP_PETSC(KSPSetOptionsPrefix(ksp_, prefix));
  POLYSLIP_PETSC(KSPGetPC(ksp_, &pc));
  POLYSLIP_PETSC(PCSetType(pc, direct ? PCLU : PCFIELDSPLIT));
  if (la::user_sets(prefix, "-pc_type"))
    choice_ = "linear solver: as the options say";
  else if (direct)
    choice_ = fmt::format("linear solver: LU factorisation of displacement and pressure (MUMPS), as {} are at most {}; "
                          "-coupled_pc_type fieldsplit for multigrid", scene, limit);
  else
    choice_ = fmt::format("linear solver: fixed stress with multigrid on displacement and pressure, as {} exceed {}; "
                          "-coupled_pc_type lu for a factorisation", scene, limit);
  POLYSLIP_PETSC(KSPSetType(ksp_, KSPFGMRES));
  POLYSLIP_PETSC(KSPGMRESSetRestart(ksp_, 100));
  POLYSLIP_PETSC(KSPSetPCSide(ksp_, PC_RIGHT));
  POLYSLIP_PETSC(KSPSetTolerances(ksp_, 1e-12, 0.0, PETSC_DEFAULT, 500));
  POLYSLIP_PETSC(KSPSetOperators(ksp_, exact_operator_, system_.condensed_matrix()));
  // Which of the two it is must be known before the rest of the options is read.
  PetscBool is_set = PETSC_FALSE, factors = PETSC_FALSE;
  char type[64] = "";
  POLYSLIP_PETSC(PetscOptionsGetString(nullptr, prefix, "-pc_type", type, sizeof type, &is_set));
  if (is_set) POLYSLIP_PETSC(PCSetType(pc, type));
  POLYSLIP_PETSC(PetscObjectTypeCompareAny(reinterpret_cast<PetscObject>(pc), &factors, PCLU, ""));
  factorises_ = factors == PETSC_TRUE;
  PetscBool splits = PETSC_FALSE;
  POLYSLIP_PETSC(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(pc), PCFIELDSPLIT, &splits));
  if (!splits) content_ = MechanicsSystem::MatrixContent::exact;
  loose_rtol_ = factorises_ ? 1e-2 : 1e-3;
  POLYSLIP_PETSC(PetscOptionsGetReal(nullptr, prefix, "-loose_rtol", &loose_rtol_, nullptr));
  if (factorises_) {
    POLYSLIP_PETSC(PCFactorSetMatSolverType(pc, MATSOLVERMUMPS));
    // The analysis must not depend on values, which permuting to a large diagonal would make it do; the diagonal is large as it is.
    la::default_option(prefix, "mat_mumps_icntl_6", "0");
  }
  if (splits)
    split_fields(pc);
  else
    system_.hold_all_rows();
  POLYSLIP_PETSC(KSPSetFromOptions(ksp_));
}

void CoupledSolver::split_fields(PC pc) {
  std::array<IS, 2> fields{};
  POLYSLIP_PETSC(MatNestGetISs(system_.condensed_matrix(), fields.data(), nullptr));
  POLYSLIP_PETSC(PCFieldSplitSetIS(pc, "displacement", fields[0]));
  POLYSLIP_PETSC(PCFieldSplitSetIS(pc, "pressure", fields[1]));
  POLYSLIP_PETSC(PCFieldSplitSetType(pc, PC_COMPOSITE_SCHUR));
  POLYSLIP_PETSC(PCFieldSplitSetSchurFactType(pc, PC_FIELDSPLIT_SCHUR_FACT_UPPER));
  POLYSLIP_PETSC(MatDuplicate(system_.pressure_matrix(), MAT_COPY_VALUES, fixed_stress_.put()));
  POLYSLIP_PETSC(PCFieldSplitSetSchurPre(pc, PC_FIELDSPLIT_SCHUR_PRE_USER, fixed_stress_));
  const std::string u = "coupled_fieldsplit_displacement_", p = "coupled_fieldsplit_pressure_";
  la::default_option(u, "ksp_type", "preonly");
  la::default_option(u, "pc_type", displacement_multigrid(system_));
  default_displacement_multigrid(system_, u, 1);
  if (la::user_chooses(u.c_str(), "-pc_type", displacement_multigrid(system_)))
    hold_rows_for_multigrid(system_, u);
  else
    system_.hold_all_rows();
  la::default_option(p, "ksp_type", "preonly");
  default_condensed_multigrid(p, system_.layout().dim());

  // b^2 |K|/K_dr on owned cells
  compressibility_ = system_.flow().layout().create_vector();
  const la::VecWrite d(compressibility_);
  const double s2 = std::pow(system_.pressure_scale(), 2);
  const int dim = system_.layout().dim();
  for (Index cell = 0; cell < system_.mesh().cells.owned; ++cell) {
    const physics::Lame& lame = system_.moduli()[cell];
    const double b = system_.flow().rock()[cell].biot;
    d[system_.flow().layout().cell(cell)] = s2 * b * b * system_.flow().fluxes().volumes()[cell] / (lame.lambda + 2 * lame.mu / dim);
  }
}

void CoupledSolver::write_fixed_stress() {
  POLYSLIP_PETSC(MatCopy(system_.pressure_matrix(), fixed_stress_, SAME_NONZERO_PATTERN));
  la::Handle<Vec> diagonal;
  POLYSLIP_PETSC(VecDuplicate(compressibility_, diagonal.put()));
  POLYSLIP_PETSC(VecCopy(compressibility_, diagonal));
  if (system_.flow().layout().with_fractures()) {
    const la::VecWrite d(diagonal);
    const mesh::DistributedMesh& mesh = system_.mesh();
    const double s2 = std::pow(system_.pressure_scale(), 2);
    for (Index f = 0; f < mesh.fractures.owned; ++f) {
      if (states_of_matrix_[f] != ContactState::open) continue;
      const assembly::ContactFace& face = std::as_const(system_).contact_cells().faces()[f];
      const double length = mesh.mesh.fracture_length[mesh.mesh.face_fracture[mesh.fracture_faces[f]]];
      const physics::Lame& lame = system_.moduli()[std::as_const(system_).contact_cells().mesh_cell(face.cell)];
      const double h = (2 * lame.mu + lame.lambda) / face.stiffness;
      d[system_.flow().layout().fracture(f)] += s2 * face.area * std::sqrt(h * length) / (2 * lame.mu + lame.lambda);
    }
  }
  POLYSLIP_PETSC(MatDiagonalSet(fixed_stress_, diagonal, ADD_VALUES));
  states_of_fixed_stress_ = states_of_matrix_;
  flow_of_setup_ = system_.flow_matrix_version();
}

/// Other flow, or more than a twentieth of the faces opened or closed since: fewer cost the Krylov method less than a new pressure block, but
/// a step begins with its own.
bool CoupledSolver::fixed_stress_is_stale() const {
  if (flow_of_setup_ != system_.flow_matrix_version()) return true;
  const long long parted = parted_since(system_.mesh().comm, states_of_fixed_stress_);
  return starts_step_ ? parted > 0 : 20 * parted > system_.fracture_faces();
}

void CoupledSolver::set_up(bool again, bool moved) {
  is_reused_ = !again && !is_factorised();
  if (factorises_)
    set_up_direct(again);
  else if (fixed_stress_.get() != nullptr)
    set_up_blocks(again, moved);
  else
    la::reuse_preconditioner(ksp_, !again);
  if (!again && !moved) return;
  changed_since_setup_ = 0;
  iterations_after_setup_ = -1;
  if (!again) return;
  has_preconditioner_ = true;
  ++counts_.setups;
  if (!factorises_) return;
  ++counts_.factorisations;
  is_as_new_for(system_.linearised_law());
  flow_of_setup_ = system_.flow_matrix_version();
}

void CoupledSolver::set_up_direct(bool again) {
  const Mat nest = system_.condensed_matrix();
  la::reuse_preconditioner(ksp_, !again);
  if (again) {
    if (assembled_.get() == nullptr) {
      POLYSLIP_PETSC(MatConvert(nest, MATAIJ, MAT_INITIAL_MATRIX, assembled_.put()));
    } else {
      Mat matrix = assembled_;
      POLYSLIP_PETSC(MatConvert(nest, MATAIJ, MAT_REUSE_MATRIX, &matrix));
    }
  }
  POLYSLIP_PETSC(KSPSetOperators(ksp_, nest, assembled_));
}

void CoupledSolver::set_up_blocks(bool again, bool moved) {
  if (again && has_preconditioner_) choose();  // for the interpolation is kept otherwise
  if (again || fixed_stress_is_stale()) write_fixed_stress();  // the pressure block sets itself up when its matrix has changed
  if (again) {
    la::reuse_preconditioner(ksp_, false);
    POLYSLIP_PETSC(KSPSetUp(ksp_));
  }
  la::reuse_preconditioner(ksp_, true);
  const auto [rock, fluid] = blocks();
  if (again) {
    PC displacement = nullptr, pressure = nullptr;
    POLYSLIP_PETSC(KSPGetPC(rock, &displacement));
    POLYSLIP_PETSC(KSPGetPC(fluid, &pressure));
    split_displacement(system_, displacement);
    split_pressure(system_.flow(), pressure);
    hierarchy_.set_up(rock);
  } else if (moved) {
    hierarchy_.follow(rock);
  }
}

std::array<KSP, 2> CoupledSolver::blocks() const {
  PC pc = nullptr;
  PetscInt n = 0;
  KSP* split = nullptr;
  POLYSLIP_PETSC(KSPGetPC(ksp_, &pc));
  POLYSLIP_PETSC(PCFieldSplitSchurGetSubKSP(pc, &n, &split));
  const std::array both{split[0], split[1]};
  POLYSLIP_PETSC(PetscFree(split));
  return both;
}

PC CoupledSolver::displacement_preconditioner() const {
  if (fixed_stress_.get() == nullptr || !has_preconditioner_) return nullptr;
  PC displacement = nullptr;
  POLYSLIP_PETSC(KSPGetPC(blocks()[0], &displacement));
  return displacement;
}

bool CoupledSolver::is_factorised() const {
  return factorises_ && !system_.flow().layout().with_fractures() && flow_of_setup_ == system_.flow_matrix_version() &&
         is_set_up_for(system_.mesh().comm, system_.linearised_law());
}

void CoupledSolver::forget_other_steps() {
  if (fixed_stress_.get() != nullptr) return;
  changed_since_setup_ = last_iterations_ = 0;
  iterations_after_setup_ = -1;
  has_preconditioner_ = is_factorised();
  if (!factorises_) choose();  // of a factorisation its order stays, which depends on the pattern alone
}

void CoupledSolver::matrix_changed(const std::vector<ContactState>& states, bool everywhere) {
  changed_since_setup_ += take_over(system_.mesh().comm, states, everywhere);
  if (starts_step_) forget_other_steps();
  const bool has_blocks = fixed_stress_.get() != nullptr;  // they follow the matrix
  const bool many = has_blocks ? are_many(changed_since_setup_) : changed_since_setup_ * system_.layout().dim() > 30;
  const bool costly = iterations_after_setup_ >= 0 && last_iterations_ > 1.5 * iterations_after_setup_ + 3;
  const bool again = factorises_ ? many || costly : !has_blocks;
  set_up(!has_preconditioner_ || again, has_blocks && (many || costly || starts_step_));
  starts_step_ = false;
}

/// Newton asks for more even where all rows together are that small: then for a part of it.
double CoupledSolver::target(const assembly::ResidualNorms& norms, double newton_rtol) const {
  const double flow = std::max(norms.flow_floor, newton_rtol * norms.flow_scale) * system_.pressure_scale();
  PetscReal size = 0;
  POLYSLIP_PETSC(VecNorm(rhs_, NORM_2, &size));
  return enough() * std::min({newton_rtol * norms.momentum_scale, flow, size});
}

PetscErrorCode CoupledSolver::solve(Vec f, Vec direction, const assembly::ResidualNorms& norms, double newton_rtol, bool loose,
                                    const IsWorthMore& is_worth_more) {
  PetscFunctionBeginUser;
  const double rtol = loose && (!factorises_ || is_reused_) ? loose_rtol_ : 0.0;
  PetscCallCXX(system_.condense_residual(f, rhs_));
  PetscCall(run(ksp_, f, direction, rtol, target(norms, newton_rtol), memory_remedy, is_worth_more));
  PetscFunctionReturn(0);
}

}  // namespace polyslip::solver
