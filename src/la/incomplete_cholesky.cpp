#include "polyslip/la/incomplete_cholesky.hpp"

#include <petsc/private/pcimpl.h>  // a preconditioner of one's own

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "polyslip/common/mpi.hpp"
#include "polyslip/la/block_factors.hpp"
#include "polyslip/la/vec_access.hpp"

namespace polyslip::la {

namespace {

using Values = BlockFactors::Values;

/// What PETSc keeps of a preconditioner of this type.
struct Data {
  PetscInt steps = 0, estimate_its = 5;
  std::array<PetscReal, 2> interval{0.3, 1.1};
  PetscMPIInt tag = 0;
  std::unique_ptr<BlockFactors> factors;
  std::optional<std::vector<PetscInt>> changed;  ///< Rows that may differ from those that were factorised in full, if known.
  double largest_eigenvalue = 0;
  std::vector<double> full_estimates;  ///< Of it, after each iteration, in the last full set-up.
  Values b, x, change, r, z;  ///< Work space.
};

Data& data_of(PC pc) { return *static_cast<Data*>(pc->data); }

/// The largest eigenvalue of M^{-1} A after each iteration of conjugate gradients from noise on some rows (all, if not said), by the matrix of
/// Lanczos' method that their coefficients make (Golub and Van Loan, Matrix Computations, section 11.3); 1 where there is no noise.
std::vector<double> largest_ritz_values(Data& data, Mat matrix, const std::optional<std::vector<PetscInt>>& on, PetscInt its) {
  BlockFactors& factors = *data.factors;
  const MPI_Comm comm = comm_of(matrix);
  Values &r = data.r, &z = data.z, &p = data.change, &q = data.x;
  const auto owned = [&](Values& values) { return factors.owned(values); };
  const auto dot = [&](Values& v, Values& w) { return mpi::sum(comm, (owned(v).cast<double>() * owned(w).cast<double>()).sum()); };
  PetscInt rows = 0;
  POLYSLIP_PETSC(MatGetLocalSize(matrix, &rows, nullptr));
  std::minstd_rand generator(static_cast<unsigned>(mpi::rank(comm)) + 1);
  std::uniform_real_distribution<PetscScalar> noise(-1, 1);
  std::vector<PetscScalar> start(static_cast<std::size_t>(rows));
  if (on) {
    for (const PetscInt row : *on) start[static_cast<std::size_t>(row)] = noise(generator);
  } else {
    for (PetscScalar& value : start) value = noise(generator);
  }
  factors.gather(start.data(), r);
  std::fill(p.begin(), p.end(), 0.0F);
  Eigen::VectorXd diagonal(its), beside(its);
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver;
  std::vector<double> largest;
  double rho = 0, alpha = 1, solved = 0;
  for (Eigen::Index n = 0; n < its; ++n) {
    factors.solve(r, z);
    const double next = dot(r, z);
    if (n == 0) solved = 1e-10 * next;  // where M is exact nothing but rounding is left after one iteration
    if (!(next > solved)) break;
    const double beta = n == 0 ? 0 : next / rho;
    rho = next;
    owned(p) = owned(z) + static_cast<float>(beta) * owned(p);
    factors.multiply(p, q);
    const double energy = dot(p, q);
    if (!(energy > 0)) break;
    if (n > 0) beside[n - 1] = std::sqrt(beta) / alpha;
    diagonal[n] = beta / alpha;
    alpha = rho / energy;
    diagonal[n] += 1 / alpha;
    owned(r) -= static_cast<float>(alpha) * owned(q);
    solver.computeFromTridiagonal(diagonal.head(n + 1), beside.head(n), Eigen::EigenvaluesOnly);
    largest.push_back(solver.eigenvalues().maxCoeff());
  }
  if (largest.empty()) largest.push_back(1);
  return largest;
}

/// A tenth of all rows at most, on all ranks.
bool are_few(const std::vector<PetscInt>& rows, Mat matrix) {
  PetscInt all = 0;
  POLYSLIP_PETSC(MatGetSize(matrix, &all, nullptr));
  return 10 * mpi::sum(comm_of(matrix), static_cast<long long>(rows.size())) <= all;
}

/// Noise on rows that have changed finds what is new beside them sooner than noise everywhere does: the estimate of the last full set-up grows
/// as that of as many iterations has. Where the rows are few three will do, and what is less than a tenth says nothing.
void estimate_largest_eigenvalue(Data& data, Mat matrix) {
  const bool is_beside_few = data.changed && are_few(*data.changed, matrix);
  const PetscInt its = is_beside_few ? std::min<PetscInt>(3, data.estimate_its) : data.estimate_its;
  const std::vector<double> estimates = largest_ritz_values(data, matrix, data.changed, its);
  if (!data.changed) data.full_estimates = estimates;
  const std::vector<double>& full = data.full_estimates;
  const double growth = estimates.back() / full[std::min(estimates.size(), full.size()) - 1];
  data.largest_eigenvalue = full.back() * (growth > (is_beside_few ? 1.1 : 1) ? growth : 1);
}

/// r = b - A x
void form_residual(Data& data) {
  BlockFactors& factors = *data.factors;
  factors.multiply(data.x, data.r);
  factors.owned(data.r) = factors.owned(data.b) - factors.owned(data.r);
}

/// Chebyshev's iteration for A x = b (Saad, Iterative Methods for Sparse Linear Systems, algorithm 12.1).
void iterate(Data& data, bool from_zero) {
  BlockFactors& factors = *data.factors;
  const auto owned = [&](Values& values) { return factors.owned(values); };
  const auto [low, high] = data.interval;
  const double centre = (high + low) / 2 * data.largest_eigenvalue, radius = (high - low) / 2 * data.largest_eigenvalue;
  const double sigma = centre / radius;
  double rho = 1 / sigma;
  for (PetscInt step = 0; step < data.steps; ++step) {
    if (step == 0 && from_zero) {
      factors.solve(data.b, data.z);
    } else {
      form_residual(data);
      factors.solve(data.r, data.z);
    }
    if (step == 0) {
      owned(data.change) = static_cast<float>(1 / centre) * owned(data.z);
    } else {
      const double next = 1 / (2 * sigma - rho);
      owned(data.change) = static_cast<float>(next * rho) * owned(data.change) + static_cast<float>(2 * next / radius) * owned(data.z);
      rho = next;
    }
    if (step == 0 && from_zero)
      owned(data.x) = owned(data.change);
    else
      owned(data.x) += owned(data.change);
  }
}

PetscErrorCode set_from_options(PC pc, PetscOptionItems* PetscOptionsObject) {  // NOLINT: the name that PETSc's macros take
  PetscFunctionBeginUser;
  Data& data = data_of(pc);
  PetscInt n = 2;
  PetscOptionsHeadBegin(PetscOptionsObject, "block_icc");
  PetscCall(PetscOptionsInt("-pc_block_icc_steps", "steps of Chebyshev's iteration; 0: the factors alone", nullptr, data.steps, &data.steps,
                            nullptr));
  PetscCall(PetscOptionsRealArray("-pc_block_icc_interval", "its ends, relative to the largest eigenvalue", nullptr, data.interval.data(), &n,
                                  nullptr));
  PetscCall(PetscOptionsInt("-pc_block_icc_estimate_its", "iterations that estimate this", nullptr, data.estimate_its, &data.estimate_its,
                            nullptr));
  PetscOptionsHeadEnd();
  PetscCheck(data.steps >= 0 && data.estimate_its > 0 && data.interval[0] > 0 && data.interval[0] < data.interval[1], comm_of(pc),
             PETSC_ERR_USER_INPUT, "block_icc: steps %d, estimate_its %d, interval %g,%g: need steps >= 0, its >= 1, 0 < low < high",
             data.steps, data.estimate_its, data.interval[0], data.interval[1]);
  PetscFunctionReturn(0);
}

PetscErrorCode set_up(PC pc) {
  PetscFunctionBeginUser;
  Data& data = data_of(pc);
  PetscBool is_aij = PETSC_FALSE;
  PetscCall(PetscObjectTypeCompareAny(reinterpret_cast<PetscObject>(pc->pmat), &is_aij, MATSEQAIJ, MATMPIAIJ, ""));
  PetscCheck(is_aij, comm_of(pc), PETSC_ERR_SUP, "block_icc takes matrices of type aij");
  if (data.tag == 0) PetscCall(PetscObjectGetNewTag(reinterpret_cast<PetscObject>(pc), &data.tag));
  if (pc->setupcalled == 0 || pc->flag == DIFFERENT_NONZERO_PATTERN) {
    data.changed.reset();
    PetscCallCXX(data.factors = block_factors(pc->pmat, data.tag, data.steps > 0));
    for (Values* values : {&data.b, &data.x, &data.change, &data.r, &data.z}) *values = data.factors->zeros();
  }
  bool is_finite = false;
  PetscCallCXX(is_finite = data.changed ? data.factors->update(pc->pmat, *data.changed) : data.factors->factorise(pc->pmat));
  if (is_finite && data.steps > 0) {
    PetscCallCXX(estimate_largest_eigenvalue(data, pc->pmat));
    is_finite = std::isfinite(data.largest_eigenvalue);
  }
  pc->failedreason = is_finite ? PC_NOERROR : PC_FACTOR_OTHER;
  PetscFunctionReturn(0);
}

PetscErrorCode apply(PC pc, Vec b, Vec x) {
  PetscFunctionBeginUser;
  Data& data = data_of(pc);
  PetscCallCXX(data.factors->gather(VecRead(b).data(), data.b));
  if (data.steps > 0) {
    PetscCallCXX(iterate(data, true));
  } else {
    PetscCallCXX(data.factors->solve(data.b, data.x));
  }
  PetscCallCXX(data.factors->scatter(data.x, VecWrite(x).data()));
  PetscFunctionReturn(0);
}

PetscErrorCode apply_richardson(PC pc, Vec b, Vec x, Vec, PetscReal, PetscReal, PetscReal, PetscInt its, PetscBool from_zero, PetscInt* done,
                                PCRichardsonConvergedReason* reason) {
  PetscFunctionBeginUser;
  Data& data = data_of(pc);
  PetscBool is_known = PETSC_FALSE;
  PetscReal norm = 0;
  PetscCallCXX(data.factors->gather(VecRead(b).data(), data.b));
  // PCMG says that smoothers start from something before it has anything, and sets that to zero: a vector knows its norm then.
  PetscCall(VecNormAvailable(x, NORM_2, &is_known, &norm));
  const bool is_zero = from_zero || (is_known && norm == 0);
  if (!is_zero) PetscCallCXX(data.factors->gather(VecRead(x).data(), data.x));
  for (PetscInt i = 0; i < its; ++i) PetscCallCXX(iterate(data, is_zero && i == 0));
  PetscCallCXX(data.factors->scatter(data.x, VecWrite(x).data()));
  *done = its;
  *reason = PCRICHARDSON_CONVERGED_ITS;
  PetscFunctionReturn(0);
}

PetscErrorCode view(PC pc, PetscViewer viewer) {
  PetscFunctionBeginUser;
  const Data& data = data_of(pc);
  PetscBool ascii = PETSC_FALSE;
  PetscCall(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(viewer), PETSCVIEWERASCII, &ascii));
  if (!ascii || !data.factors) PetscFunctionReturn(0);
  PetscCall(PetscViewerASCIIPrintf(viewer, "  blocks of %d in half and single precision, %d diagonal blocks of rank 0 damped\n", data.factors->block(),
                                   data.factors->damped()));
  if (data.steps > 0)
    PetscCall(PetscViewerASCIIPrintf(viewer, "  %d steps of Chebyshev's iteration on [%g, %g] x %g\n", data.steps, data.interval[0],
                                     data.interval[1], data.largest_eigenvalue));
  PetscFunctionReturn(0);
}

PetscErrorCode reset(PC pc) {
  PetscFunctionBeginUser;
  data_of(pc).factors.reset();
  PetscFunctionReturn(0);
}

PetscErrorCode destroy(PC pc) {
  PetscFunctionBeginUser;
  delete static_cast<Data*>(pc->data);
  pc->data = nullptr;
  PetscFunctionReturn(0);
}

PetscErrorCode create(PC pc) {
  PetscFunctionBeginUser;
  pc->ops->setfromoptions = set_from_options;
  pc->ops->setup = set_up;
  pc->ops->apply = apply;
  pc->ops->applytranspose = apply;
  pc->ops->applyrichardson = apply_richardson;
  pc->ops->view = view;
  pc->ops->reset = reset;
  pc->ops->destroy = destroy;
  pc->data = new Data;
  PetscFunctionReturn(0);
}

bool is_block_icc(PC pc) {
  PetscBool is = PETSC_FALSE;
  POLYSLIP_PETSC(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(pc), block_icc, &is));
  return is == PETSC_TRUE;
}

bool iterates(PC pc) { return is_block_icc(pc) && data_of(pc).steps > 0; }

/// r = b - A x, A the matrix that a preconditioner keeps.
PetscErrorCode residual(Mat shell, Vec b, Vec x, Vec r) {
  PetscFunctionBeginUser;
  PC pc = nullptr;
  PetscCall(MatShellGetContext(shell, &pc));
  Data& data = data_of(pc);
  PetscCallCXX(data.factors->gather(VecRead(b).data(), data.b));
  PetscCallCXX(data.factors->gather(VecRead(x).data(), data.x));
  PetscCallCXX(form_residual(data));
  PetscCallCXX(data.factors->scatter(data.r, VecWrite(r).data()));
  PetscFunctionReturn(0);
}

PetscErrorCode forget_preconditioner(Mat shell) {
  PetscFunctionBeginUser;
  PC pc = nullptr;
  PetscCall(MatShellGetContext(shell, &pc));
  PetscCall(PetscObjectDereference(reinterpret_cast<PetscObject>(pc)));
  PetscFunctionReturn(0);
}

}  // namespace

double largest_eigenvalue(PC pc) { return data_of(pc).largest_eigenvalue; }

void set_up_for_changed_rows(KSP ksp, Mat matrix, const std::vector<PetscInt>& rows) {
  PC pc = nullptr;
  POLYSLIP_PETSC(KSPGetPC(ksp, &pc));
  POLYSLIP_PETSC(KSPSetOperators(ksp, matrix, matrix));
  if (is_block_icc(pc)) data_of(pc).changed = rows;
  POLYSLIP_PETSC(KSPSetUp(ksp));
}

void forget_changed_rows(KSP ksp) {
  PC pc = nullptr;
  POLYSLIP_PETSC(KSPGetPC(ksp, &pc));
  if (is_block_icc(pc)) data_of(pc).changed.reset();
}

void take_residuals_from_smoothers(PC hierarchy) {
  PetscInt levels = 0;
  POLYSLIP_PETSC(PCMGGetLevels(hierarchy, &levels));
  for (PetscInt level = 1; level < levels; ++level) {
    KSP smoother = nullptr;
    PC pc = nullptr;
    Mat matrix = nullptr;
    PetscInt rows = 0, columns = 0;
    POLYSLIP_PETSC(PCMGGetSmoother(hierarchy, level, &smoother));
    POLYSLIP_PETSC(KSPGetPC(smoother, &pc));
    if (!iterates(pc)) continue;
    POLYSLIP_PETSC(KSPGetOperators(smoother, nullptr, &matrix));
    POLYSLIP_PETSC(MatGetLocalSize(matrix, &rows, &columns));
    Handle<Mat> shell;
    POLYSLIP_PETSC(MatCreateShell(comm_of(pc), rows, columns, PETSC_DETERMINE, PETSC_DETERMINE, pc, shell.put()));
    POLYSLIP_PETSC(PetscObjectReference(reinterpret_cast<PetscObject>(pc)));
    POLYSLIP_PETSC(MatShellSetOperation(shell, MATOP_RESIDUAL, reinterpret_cast<void (*)()>(residual)));
    POLYSLIP_PETSC(MatShellSetOperation(shell, MATOP_DESTROY, reinterpret_cast<void (*)()>(forget_preconditioner)));
    POLYSLIP_PETSC(PCMGSetResidual(hierarchy, level, PCMGResidualDefault, shell));
  }
}

PetscErrorCode register_block_icc() {
  PetscFunctionBeginUser;
  PetscCall(PCRegister(block_icc, create));
  PetscFunctionReturn(0);
}

}  // namespace polyslip::la
