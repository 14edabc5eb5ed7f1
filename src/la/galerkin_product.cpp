#include "polyslip/la/galerkin_product.hpp"

#include <petsc/private/matimpl.h>  // a product of one's own

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <memory>
#include <numeric>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "polyslip/common/mpi.hpp"
#include "polyslip/common/types.hpp"
#include "polyslip/la/aggregation_graph.hpp"
#include "polyslip/la/aij_parts.hpp"
#include "polyslip/la/block_rows.hpp"
#include "polyslip/la/lanes.hpp"
#include "polyslip/la/prolongation.hpp"
#include "polyslip/la/rank_order.hpp"

namespace polyslip::la {

namespace {

constexpr const char *by_petsc = "polyslip_product_by_petsc_C", *symmetric = "polyslip_product_symmetric_C",
                     *sequential = "MatProductSetFromOptions_seqaij_seqaij_C", *parallel = "MatProductSetFromOptions_mpiaij_mpiaij_C";
constexpr Index none = -1;

template <int r, int c>
bool consists_of_blocks(Mat matrix) {
  const AijParts parts(matrix);
  PetscInt first_row = 0, first_column = 0, columns = 0;
  POLYSLIP_PETSC(MatGetOwnershipRange(matrix, &first_row, nullptr));
  POLYSLIP_PETSC(MatGetOwnershipRangeColumn(matrix, &first_column, nullptr));
  POLYSLIP_PETSC(MatGetLocalSize(matrix, nullptr, &columns));
  if (first_row % r != 0 || first_column % c != 0 || columns % c != 0 || !BlockRows<r, c>(parts.own).are_whole(nullptr)) return false;
  return parts.others == nullptr || BlockRows<r, c>(parts.others).are_whole(parts.global);
}

/// sum += left right, of m x k and k x n entries; left(i, l) is an entry. Row by row, as the compiler inlines and vectorises that.
template <int m, int k, int n, class Left>
void add_product(Left&& left, const double* right, PetscInt width, double* sum) {
  using Row = Eigen::Array<double, n, 1>;
  for (int i = 0; i < m; ++i) {
    Eigen::Map<Row> to(sum + i * n);
    Row row = to;
    for (int l = 0; l < k; ++l) row += left(i, l) * Eigen::Map<const Row>(right + l * width);
    to = row;
  }
}

/// Writes a local MATAIJ of blocks of r x c entries, row by row.
template <int r, int c>
class BlockWriter {
 public:
  BlockWriter(Mat matrix, Index owned) : matrix_(matrix), parts_(matrix), owned_(owned) {
    POLYSLIP_PETSC(MatSeqAIJGetArray(parts_.own, &own_));
    if (parts_.others != nullptr) POLYSLIP_PETSC(MatSeqAIJGetArray(parts_.others, &others_));
    next_own_ = own_;
    next_of_others_ = others_;
  }
  /// block(k) points at the entries in column k of these: ascending, those from `owned` on being of others.
  template <class Block>
  void append(std::span<const Index> columns, Block&& block) {
    for (int i = 0; i < r; ++i)
      for (std::size_t k = 0; k < columns.size(); ++k) {
        PetscScalar*& next = columns[k] < owned_ ? next_own_ : next_of_others_;
        copy_numbers<c>(block(k) + i * c, next);
        next += c;
      }
  }
  void finish() {
    POLYSLIP_PETSC(MatSeqAIJRestoreArray(parts_.own, &own_));
    if (parts_.others != nullptr) POLYSLIP_PETSC(MatSeqAIJRestoreArray(parts_.others, &others_));
    POLYSLIP_PETSC(PetscObjectStateIncrease(reinterpret_cast<PetscObject>(matrix_)));
    POLYSLIP_PETSC(MatAssemblyBegin(matrix_, MAT_FINAL_ASSEMBLY));
    POLYSLIP_PETSC(MatAssemblyEnd(matrix_, MAT_FINAL_ASSEMBLY));
  }

 private:
  Mat matrix_;
  AijParts parts_;
  Index owned_;
  PetscScalar *own_ = nullptr, *others_ = nullptr, *next_own_ = nullptr, *next_of_others_ = nullptr;
};

class Product {
 public:
  Product() = default;
  Product(const Product&) = delete;
  Product& operator=(const Product&) = delete;
  virtual ~Product() = default;
  /// Writes the entries of the product.
  virtual void multiply(Mat a, Mat p, Mat product) = 0;

  bool is_symmetric = false;  ///< A
};

/// Nodes of this rank are followed by the ghosts of A; aggregates, in an order of their own, likewise by those of the product.
template <int b, int c>
class ProductWithP : public Product {
 public:
  ~ProductWithP() override {
    if (ghost_rows_ != nullptr) (void)MatDestroySubMatrices(1, &ghost_rows_);
  }

 protected:
  /// A and P while they are read.
  struct Factors {
    BlockRows<b, b> a;
    BlockRows<b, c> p;
    std::optional<BlockRows<b, b>> a_of_others;
    std::optional<BlockRows<b, c>> p_of_others, p_of_ghosts;
    Index nodes;
    const ProductWithP& product;

    Factors(const ProductWithP& its, Mat a_matrix, Mat p_matrix) : Factors(its, AijParts(a_matrix), AijParts(p_matrix)) {}
    Factors(const ProductWithP& its, const AijParts& of_a, const AijParts& of_p) : a(of_a.own, of_a.lent), p(of_p.own), nodes(a.rows()), product(its) {
      if (of_a.others != nullptr) a_of_others.emplace(of_a.others);
      if (of_p.others != nullptr) p_of_others.emplace(of_p.others);
      if (its.ghost_rows_ != nullptr) p_of_ghosts.emplace(its.ghost_rows_[0]);
    }
    template <class Visit>
    void visit_a(Index i, Visit&& visit) const {
      a.visit(i, visit);
      visit_a_of_others(i, visit);
    }
    /// Of a symmetric matrix, what adds up to it with its transposed: nodes of this rank alone.
    template <class Visit>
    void visit_half_of_a(Index i, Visit&& visit) const {
      a.visit_lower(i, [&](Index j, const double* block, PetscInt width) {
        if (j < i) return visit(j, block, width);
        std::array<double, b * b> half;
        for (int r = 0; r < b; ++r)
          for (int l = 0; l < b; ++l) half[static_cast<std::size_t>(r * b + l)] = block[r * width + l] / 2;
        visit(j, half.data(), b);
      });
    }
    template <class Visit>
    void visit_a_of_others(Index i, Visit&& visit) const {
      if (a_of_others) a_of_others->visit(i, [&](Index ghost, const double* block, PetscInt width) { visit(nodes + ghost, block, width); });
    }
    template <class Visit>
    void visit_own_p(Index i, Visit&& visit) const {
      p.visit(i, visit);
      if (p_of_others) p_of_others->visit(i, [&](Index k, const double* block, PetscInt width) { visit(product.of_others_[k], block, width); });
    }
    template <class Visit>
    void visit_p(Index i, Visit&& visit) const {
      if (i < nodes) return visit_own_p(i, visit);
      const Index* column = product.of_ghost_rows_[i - nodes].data();
      p_of_ghosts->visit(i - nodes, [&](Index, const double* block, PetscInt width) { visit(*column++, block, width); });
    }
  };

  /// The rows of P of the ghosts of A.
  void fetch_rows(Mat a, Mat p) {
    const AijParts parts(a);
    if (parts.others == nullptr) return;
    if (ghost_rows_ == nullptr) {
      PetscInt n = 0, columns = 0;
      POLYSLIP_PETSC(MatGetSize(parts.others, nullptr, &n));
      POLYSLIP_PETSC(MatGetSize(p, nullptr, &columns));
      POLYSLIP_PETSC(ISCreateGeneral(PETSC_COMM_SELF, n, parts.global, PETSC_COPY_VALUES, wanted_.put()));
      POLYSLIP_PETSC(ISCreateStride(PETSC_COMM_SELF, columns, 0, 1, all_.put()));
    }
    const IS rows = wanted_, columns = all_;
    POLYSLIP_PETSC(MatCreateSubMatrices(p, 1, &rows, &columns, ghost_rows_ == nullptr ? MAT_INITIAL_MATRIX : MAT_REUSE_MATRIX, &ghost_rows_));
  }

  [[nodiscard]] bool is_own(GlobalIndex aggregate) const { return aggregate >= first_ && aggregate < first_ + owned_; }
  [[nodiscard]] Index local(GlobalIndex aggregate) const {
    if (is_own(aggregate)) return aggregate - first_;
    return owned_ + static_cast<Index>(std::lower_bound(ghosts_.begin(), ghosts_.end(), aggregate) - ghosts_.begin());
  }
  [[nodiscard]] GlobalIndex global(Index aggregate) const {
    return aggregate < owned_ ? first_ + aggregate : ghosts_[static_cast<std::size_t>(aggregate - owned_)];
  }
  [[nodiscard]] Index aggregates() const { return owned_ + static_cast<Index>(ghosts_.size()); }
  void sort_ghosts() {
    std::sort(ghosts_.begin(), ghosts_.end());
    ghosts_.erase(std::unique(ghosts_.begin(), ghosts_.end()), ghosts_.end());
  }

  void number_aggregates(Mat p, const Factors& factors) {
    PetscInt n = 0, first = 0;
    POLYSLIP_PETSC(MatGetLocalSize(p, nullptr, &n));
    POLYSLIP_PETSC(MatGetOwnershipRangeColumn(p, &first, nullptr));
    owned_ = n / c;
    first_ = first / c;
    const std::vector<GlobalIndex> of_others = ghosts_of(AijParts(p), c);
    ghosts_ = of_others;
    const auto visit_ghost_rows = [&](auto&& visit) {
      for (Index i = 0; factors.p_of_ghosts && i < factors.p_of_ghosts->rows(); ++i) visit(i);
    };
    visit_ghost_rows([&](Index i) {
      factors.p_of_ghosts->visit(i, [&](GlobalIndex aggregate, const double*, PetscInt) {
        if (!is_own(aggregate)) ghosts_.push_back(aggregate);
      });
    });
    sort_ghosts();
    for (GlobalIndex aggregate : of_others) of_others_.push_back(local(aggregate));
    std::vector<Index> row;
    visit_ghost_rows([&](Index i) {
      row.clear();
      factors.p_of_ghosts->visit(i, [&](GlobalIndex aggregate, const double*, PetscInt) { row.push_back(local(aggregate)); });
      of_ghost_rows_.push_row(row);
    });
  }

  /// The columns of the rows of A P.
  [[nodiscard]] Csr columns_of_rows(const Factors& factors) const {
    std::vector<Index> seen(static_cast<std::size_t>(aggregates()), none), columns;
    Csr rows;
    for (Index i = 0; i < factors.nodes; ++i) {
      columns.clear();
      factors.visit_a(i, [&](Index j, const double*, PetscInt) {
        factors.visit_p(j, [&](Index aggregate, const double*, PetscInt) {
          if (std::exchange(seen[static_cast<std::size_t>(aggregate)], i) != i) columns.push_back(aggregate);
        });
      });
      rows.push_row(columns);
    }
    return rows;
  }

  /// Gives the product its entries, to be written yet: rows of blocks of r x c.
  template <int r>
  void set_pattern(const Csr& rows, Index count, Mat product) const {
    const auto entries_of = [&](auto&& is_in_it, auto&& number) {
      AijEntries entries;
      std::vector<PetscInt> of_row;
      entries.offsets.reserve(static_cast<std::size_t>(count * r) + 1);
      entries.columns.reserve(static_cast<std::size_t>(rows.offsets[count]) * r * c);
      for (Index row = 0; row < count; ++row) {
        of_row.clear();
        for (Index column : rows[row])
          for (int j = 0; is_in_it(column) && j < c; ++j) of_row.push_back(number(column) * c + j);
        for (int i = 0; i < r; ++i) {
          entries.columns.insert(entries.columns.end(), of_row.begin(), of_row.end());
          entries.offsets.push_back(static_cast<PetscInt>(entries.columns.size()));
        }
      }
      entries.values.resize(entries.columns.size());
      return entries;
    };
    AijEntries others;
    others.offsets.assign(static_cast<std::size_t>(count * r) + 1, 0);
    if (!ghosts_.empty()) others = entries_of([&](Index column) { return column >= owned_; }, [&](Index column) { return global(column); });
    AijEntries own = entries_of([&](Index column) { return column < owned_; }, [](Index column) { return column; });
    Mat matrix = matrix_of(comm_of(product), owned_ * c, std::move(own), std::move(others)).release();
    POLYSLIP_PETSC(MatSetBlockSizes(matrix, r, c));
    matrix->product = std::exchange(product->product, nullptr);
    POLYSLIP_PETSC(MatHeaderReplace(product, &matrix));
  }

  Index owned_ = 0;                  ///< Aggregates of this rank.
  GlobalIndex first_ = 0;            ///< Number of the first of them.
  std::vector<GlobalIndex> ghosts_;  ///< Aggregates of others, ascending.
  std::vector<Index> of_others_;     ///< Aggregate of each column of P that others own.
  Csr of_ghost_rows_;                ///< Aggregates of each row of P that is fetched.

 private:
  Handle<IS> wanted_, all_;    ///< Rows and columns of P to fetch.
  Mat* ghost_rows_ = nullptr;  ///< One matrix, where there are other ranks.
};

/// One row of A P at a time.
template <int b, int c>
class RowOfAp {
 public:
  explicit RowOfAp(Index aggregates) : slot_(static_cast<std::size_t>(aggregates), none) {}

  /// visit_a calls what it is given for the blocks of a row of A.
  template <class Factors, class VisitA>
  void multiply(const Factors& factors, VisitA&& visit_a) {
    for (Index column : columns_) slot_[static_cast<std::size_t>(column)] = none;
    columns_.clear();
    Index* const slot = slot_.data();  // what Eigen writes might be anything of this object, for all the compiler knows
    double* blocks = blocks_.data();
    visit_a([&](Index j, const double* a, PetscInt a_width) {
      factors.visit_p(j, [&](Index aggregate, const double* p, PetscInt p_width) {
        if (slot[aggregate] == none) {
          slot[aggregate] = append(aggregate);
          blocks = blocks_.data();
        }
        add_product<b, b, c>([&](int r, int l) { return a[r * a_width + l]; }, p, p_width, blocks + slot[aggregate] * size);
      });
    });
  }
  [[nodiscard]] bool is_empty() const { return columns_.empty(); }
  /// W_iK of all aggregates: null where there is none.
  [[nodiscard]] auto row() const {
    return [slot = slot_.data(), blocks = blocks_.data()](Index aggregate) {
      return slot[aggregate] == none ? nullptr : blocks + slot[aggregate] * size;
    };
  }

 private:
  static constexpr Index size = b * c;

  Index append(Index aggregate) {
    const auto at = static_cast<Index>(columns_.size());
    columns_.push_back(aggregate);
    const std::size_t needed = columns_.size() * size;
    if (blocks_.size() < needed) blocks_.resize(2 * needed);
    std::fill_n(blocks_.data() + at * size, size, 0.0);
    return at;
  }

  std::vector<Index> slot_, columns_;  ///< Place of each aggregate among those of the row, or `none`; those of the row.
  std::vector<double> blocks_;
};

/// W = A P
template <int b, int c>
class ProductAp final : public ProductWithP<b, c> {
  using Base = ProductWithP<b, c>;

 public:
  /// Finds the pattern of the product, and gives it that.
  void find_pattern(Mat a, Mat p, Mat product) {
    Base::fetch_rows(a, p);
    {
      const typename Base::Factors factors(*this, a, p);
      Base::number_aggregates(p, factors);
      rows_ = Base::columns_of_rows(factors);
    }
    for (Index i = 0; i < rows_.rows(); ++i) std::sort(rows_[i].begin(), rows_[i].end());
    Base::template set_pattern<b>(rows_, rows_.rows(), product);
  }

  void multiply(Mat a, Mat p, Mat product) override {
    Base::fetch_rows(a, p);
    const typename Base::Factors factors(*this, a, p);
    RowOfAp<b, c> w(Base::aggregates());
    BlockWriter<b, c> writer(product, this->owned_);
    for (Index i = 0; i < factors.nodes; ++i) {
      w.multiply(factors, [&](auto&& visit) { factors.visit_a(i, visit); });
      const std::span<const Index> columns = std::as_const(rows_)[i];
      writer.append(columns, [row = w.row(), columns](std::size_t k) { return row(columns[k]); });
    }
    writer.finish();
  }

 private:
  Csr rows_;  ///< Columns by aggregates, ascending.
};

/// C = P^T A P
template <int b, int c>
class ProductPtAp final : public ProductWithP<b, c> {
  using Base = ProductWithP<b, c>;
  using Factors = typename Base::Factors;
  using Base::ghosts_, Base::global, Base::is_own, Base::local, Base::owned_;

 public:
  /// Finds the pattern of the product, and gives it that.
  void find_pattern(Mat a, Mat p, Mat product) {
    Base::fetch_rows(a, p);
    {
      const Factors factors(*this, a, p);
      Base::number_aggregates(p, factors);
      find_rows(factors);
    }
    exchange_rows(product);
    Base::template set_pattern<c>(rows_, owned_, product);
  }

  void multiply(Mat a, Mat p, Mat product) override {
    Base::fetch_rows(a, p);
    const Factors factors(*this, a, p);
    std::vector<double> sums(rows_.values.size() * size, 0.0);
    RowOfAp<b, c> w(Base::aggregates());
    /// visit_a(i, visit) for the blocks of row i of A that are to be added.
    const auto add = [&](auto&& visit_a) {
      for (Index i = 0; i < factors.nodes; ++i) {
        w.multiply(factors, [&](auto&& visit) { visit_a(i, visit); });
        if (w.is_empty()) continue;
        factors.visit_own_p(i, [&, row = w.row()](Index aggregate, const double* block, PetscInt width) {
          double* sum = at(sums, rows_.offsets[aggregate]);
          for (Index column : std::as_const(rows_)[aggregate]) {
            if (const double* its = row(column); its != nullptr)
              add_product<c, b, c>([&](int r, int l) { return block[l * width + r]; }, its, c, sum);
            sum += size;
          }
        });
      }
    };
    if (this->is_symmetric) {
      add([&](Index i, auto&& visit) { factors.visit_half_of_a(i, visit); });
      add_transposed(sums);
      add([&](Index i, auto&& visit) { factors.visit_a_of_others(i, visit); });
    } else {
      add([&](Index i, auto&& visit) { factors.visit_a(i, visit); });
    }
    exchange_sums(sums, product);
    BlockWriter<c, c> writer(product, owned_);
    for (Index row = 0; row < owned_; ++row)
      writer.append(std::as_const(rows_)[row], [&](std::size_t k) { return at(sums, rows_.offsets[row] + static_cast<Index>(k)); });
    writer.finish();
  }

 private:
  static constexpr std::size_t size = c * c;
  static double* at(std::vector<double>& sums, Index block) { return sums.data() + static_cast<std::size_t>(block) * size; }

  /// Of nodes of this rank alone, where all that is not zero has its place on both sides of the diagonal.
  void add_transposed(std::vector<double>& sums) const {
    using Block = Eigen::Map<Eigen::Matrix<double, c, c, Eigen::RowMajor>>;
    for (Index row = 0; row < rows_.rows(); ++row)
      for (Index k = rows_.offsets[row]; k < rows_.offsets[row + 1]; ++k) {
        const Index column = rows_.values[static_cast<std::size_t>(k)];
        if (column < row) continue;
        const std::span<const Index> mirrored = std::as_const(rows_)[column];
        const auto place = std::lower_bound(mirrored.begin(), mirrored.end(), row);
        if (place == mirrored.end() || *place != row) continue;
        Block above(at(sums, k)), below(at(sums, rows_.offsets[column] + static_cast<Index>(place - mirrored.begin())));
        above += below.transpose().eval();
        below = above.transpose().eval();
      }
  }

  /// The columns of the rows of C that nodes of this rank add to.
  void find_rows(const Factors& factors) {
    const Csr of_w = Base::columns_of_rows(factors);
    std::vector<Index> fill(static_cast<std::size_t>(Base::aggregates()) + 1, 0);
    const auto visit_aggregates = [&](Index i, auto&& visit) {
      factors.visit_own_p(i, [&](Index aggregate, const double*, PetscInt) { visit(static_cast<std::size_t>(aggregate)); });
    };
    for (Index i = 0; i < factors.nodes; ++i) visit_aggregates(i, [&](std::size_t aggregate) { ++fill[aggregate + 1]; });
    std::partial_sum(fill.begin(), fill.end(), fill.begin());
    Csr nodes_of;
    nodes_of.offsets = fill;
    nodes_of.values.resize(static_cast<std::size_t>(fill.back()));
    for (Index i = 0; i < factors.nodes; ++i)
      visit_aggregates(i, [&](std::size_t aggregate) { nodes_of.values[static_cast<std::size_t>(fill[aggregate]++)] = i; });
    std::vector<Index> seen(static_cast<std::size_t>(Base::aggregates()), none), columns;
    for (Index aggregate = 0; aggregate < nodes_of.rows(); ++aggregate) {
      columns.clear();
      for (Index i : std::as_const(nodes_of)[aggregate])
        for (Index column : of_w[i])
          if (std::exchange(seen[static_cast<std::size_t>(column)], aggregate) != aggregate) columns.push_back(column);
      std::sort(columns.begin(), columns.end());
      rows_.push_row(columns);
    }
  }

  /// Tells other ranks the columns of their rows, and adds what they tell to those of this rank: new ghosts, maybe.
  void exchange_rows(Mat product) {
    POLYSLIP_PETSC(PetscObjectGetNewTag(reinterpret_cast<PetscObject>(product), &tag_));
    if (mpi::size(comm_of(product)) == 1) return;
    Exchange exchange(comm_of(product), tag_);
    neighbours_ = find_neighbours(comm_of(product), owned_, ghosts_);
    std::vector<std::vector<PetscInt>> messages(neighbours_.size()), received(neighbours_.size());
    for (std::size_t n = 0; n < neighbours_.size(); ++n) {
      for (PetscInt ghost : neighbours_[n].ghosts) {
        const std::span<const Index> row = std::as_const(rows_)[owned_ + ghost];
        messages[n].push_back(static_cast<PetscInt>(row.size()));
        for (Index column : row) messages[n].push_back(global(column));
      }
      if (!messages[n].empty()) exchange.send(neighbours_[n].rank, messages[n]);
    }
    for (std::size_t n = 0; n < neighbours_.size(); ++n)
      if (!neighbours_[n].nodes.empty()) exchange.receive(neighbours_[n].rank, received[n]);
    exchange.finish();
    renumber(received);
    merge(received);
  }

  /// Calls visit(aggregate of this rank, its columns by global numbers) for a message.
  template <class Visit>
  static void visit_message(const Neighbour& neighbour, const std::vector<PetscInt>& message, Visit&& visit) {
    const PetscInt* next = message.data();
    for (PetscInt aggregate : neighbour.nodes) {
      const auto n = static_cast<std::size_t>(*next++);
      visit(aggregate, std::span(next, n));
      next += n;
    }
  }

  void renumber(const std::vector<std::vector<PetscInt>>& received) {
    const std::vector<GlobalIndex> before = ghosts_;
    for (std::size_t n = 0; n < neighbours_.size(); ++n)
      visit_message(neighbours_[n], received[n], [&](Index, std::span<const PetscInt> columns) {
        for (PetscInt column : columns)
          if (!is_own(column)) ghosts_.push_back(column);
      });
    Base::sort_ghosts();
    const auto now = [&](Index column) { return column < owned_ ? column : local(before[static_cast<std::size_t>(column - owned_)]); };
    for (std::vector<Index>* columns : {&this->of_others_, &this->of_ghost_rows_.values, &rows_.values})
      for (Index& column : *columns) column = now(column);
    for (Neighbour& n : neighbours_)
      for (PetscInt& ghost : n.ghosts) ghost = now(owned_ + ghost) - owned_;
    Csr rows;
    std::size_t known = 0;
    for (Index row = 0; row < owned_; ++row) rows.push_row(std::as_const(rows_)[row]);
    for (GlobalIndex ghost : ghosts_) {
      const bool is_known = known < before.size() && before[known] == ghost;
      rows.push_row(is_known ? std::as_const(rows_)[owned_ + static_cast<Index>(known++)] : std::span<const Index>());
    }
    rows_ = std::move(rows);
  }

  void merge(const std::vector<std::vector<PetscInt>>& received) {
    std::vector<std::vector<Index>> more(static_cast<std::size_t>(rows_.rows()));
    for (std::size_t n = 0; n < neighbours_.size(); ++n)
      visit_message(neighbours_[n], received[n], [&](Index aggregate, std::span<const PetscInt> columns) {
        for (PetscInt column : columns) more[static_cast<std::size_t>(aggregate)].push_back(local(column));
      });
    Csr merged;
    for (Index row = 0; row < rows_.rows(); ++row) {
      std::vector<Index>& columns = more[static_cast<std::size_t>(row)];
      const std::span<const Index> own = std::as_const(rows_)[row];
      columns.insert(columns.end(), own.begin(), own.end());
      std::sort(columns.begin(), columns.end());
      columns.erase(std::unique(columns.begin(), columns.end()), columns.end());
      merged.push_row(columns);
    }
    rows_ = std::move(merged);
    std::vector<Index> places;
    for (std::size_t n = 0; n < neighbours_.size(); ++n) {
      places.clear();
      visit_message(neighbours_[n], received[n], [&](Index aggregate, std::span<const PetscInt> columns) {
        const std::span<const Index> row = std::as_const(rows_)[aggregate];
        for (PetscInt column : columns)
          places.push_back(rows_.offsets[aggregate] + static_cast<Index>(std::lower_bound(row.begin(), row.end(), local(column)) - row.begin()));
      });
      places_.push_row(places);
    }
  }

  /// Sends the sums of rows of other ranks to these, and adds what they send.
  void exchange_sums(std::vector<double>& sums, Mat product) const {
    Exchange exchange(comm_of(product), tag_);
    std::vector<std::vector<double>> messages(neighbours_.size());
    for (std::size_t n = 0; n < neighbours_.size(); ++n) {
      for (PetscInt ghost : neighbours_[n].ghosts) {
        const auto* offset = rows_.offsets.data() + owned_ + ghost;
        messages[n].insert(messages[n].end(), sums.data() + static_cast<std::size_t>(offset[0]) * size,
                           sums.data() + static_cast<std::size_t>(offset[1]) * size);
      }
      if (!neighbours_[n].ghosts.empty()) exchange.send(neighbours_[n].rank, messages[n]);
    }
    std::vector<double> received;
    for (std::size_t n = 0; n < neighbours_.size(); ++n) {
      if (neighbours_[n].nodes.empty()) continue;
      exchange.receive(neighbours_[n].rank, received);
      const double* next = received.data();
      for (Index place : places_[static_cast<Index>(n)])
        for (std::size_t e = 0; e < size; ++e) sums[static_cast<std::size_t>(place) * size + e] += *next++;
    }
    exchange.finish();
  }

  Csr rows_;  ///< Columns of C by aggregates, ghosts at the end.
  std::vector<Neighbour> neighbours_;
  Csr places_;  ///< Of what each neighbour sends, among the blocks of C.
  PetscMPIInt tag_ = 0;
};

PetscErrorCode destroy(void* data) {
  PetscFunctionBeginUser;
  delete static_cast<Product*>(data);
  PetscFunctionReturn(0);
}

/// Y += a X where Y has an entry for each of X. PETSc's looks for the place of each, and makes a new Y of it on several ranks.
PetscErrorCode add_subset(Mat y, PetscScalar a, Mat x, MatStructure structure) {
  PetscFunctionBeginUser;
  if (structure != SUBSET_NONZERO_PATTERN) {
    PetscCall((*x->ops->axpy)(y, a, x, structure));
    PetscFunctionReturn(0);
  }
  const AijParts to(y), from(x);
  const auto add = [&](Mat to_part, Mat from_part, auto&& to_number, auto&& from_number) {
    const AijRows rows(to_part), added(from_part);
    const AijValues values(to_part);
    for (PetscInt row = 0; row < rows.rows(); ++row) {
      PetscInt place = rows.offsets()[row];
      added.visit(row, 1, [&](PetscInt, PetscInt column, PetscScalar value) {
        while (to_number(rows.columns()[place]) < from_number(column)) ++place;
        values.data()[place] += a * value;
      });
    }
  };
  const auto local = [](PetscInt column) { return column; };
  PetscCallCXX(add(to.own, from.own, local, local));
  if (to.others != nullptr)
    PetscCallCXX(add(to.others, from.others, [&](PetscInt k) { return to.global[k]; }, [&](PetscInt k) { return from.global[k]; }));
  PetscCall(PetscObjectStateIncrease(reinterpret_cast<PetscObject>(y)));
  PetscFunctionReturn(0);
}

PetscErrorCode multiply(Mat product) {
  PetscFunctionBeginUser;
  PetscCallCXX(static_cast<Product*>(product->product->data)->multiply(product->product->A, product->product->B, product));
  PetscFunctionReturn(0);
}

template <class ProductOfBlocks>
PetscErrorCode find_pattern(Mat product) {
  PetscFunctionBeginUser;
  Mat_Product& its = *product->product;
  auto by_blocks = std::make_unique<ProductOfBlocks>();
  PetscCallCXX(by_blocks->is_symmetric = forms_symmetric_products(its.A));
  PetscCallCXX(by_blocks->find_pattern(its.A, its.B, product));
  its.data = by_blocks.release();
  its.destroy = destroy;
  product->ops->productnumeric = multiply;  // the type of the matrix, set just now, has its own
  if (its.type == MATPRODUCT_AB) {
    product->ops->axpy = add_subset;  // of P itself, for a smoothed one
  } else {
    PetscCallCXX(multiply_by_blocks(its.B));
    PetscCallCXX(form_galerkin_products_by_blocks(product, forms_symmetric_products(its.A)));
    PetscCallCXX(form_graphs_by_blocks(product));
  }
  PetscFunctionReturn(0);
}

using Method = PetscErrorCode (*)(Mat);

template <int b, int c>
Method method_for(const Mat_Product& product) {
  const bool is_here = consists_of_blocks<b, b>(product.A) && consists_of_blocks<b, c>(product.B);
  if (mpi::any(comm_of(product.A), !is_here)) return nullptr;
  return product.type == MATPRODUCT_AB ? find_pattern<ProductAp<b, c>> : find_pattern<ProductPtAp<b, c>>;
}

/// Null where the blocks are none of those known.
Method choose_method(const Mat_Product& product) {
  PetscInt b = 0, c = 0;
  PetscBool is_aij = PETSC_FALSE, is_wanted = PETSC_TRUE;
  POLYSLIP_PETSC(PetscOptionsGetBool(nullptr, nullptr, "-galerkin_by_blocks", &is_wanted, nullptr));
  POLYSLIP_PETSC(PetscObjectTypeCompareAny(reinterpret_cast<PetscObject>(product.B), &is_aij, MATSEQAIJ, MATMPIAIJ, ""));
  POLYSLIP_PETSC(MatGetBlockSizes(product.B, &b, &c));
  if (!is_wanted || !is_aij || (product.type != MATPRODUCT_AB && product.type != MATPRODUCT_PtAP)) return nullptr;
  if (b == 2 && c == 3) return method_for<2, 3>(product);
  if (b == 3 && c == 3) return method_for<3, 3>(product);
  if (b == 3 && c == 6) return method_for<3, 6>(product);
  if (b == 6 && c == 6) return method_for<6, 6>(product);
  return nullptr;
}

/// That is composed with a matrix; null where none is.
Method method_of(Mat matrix, const char* name) {
  Method method = nullptr;
  POLYSLIP_PETSC(PetscObjectQueryFunction(reinterpret_cast<PetscObject>(matrix), name, &method));
  return method;
}

PetscErrorCode set_from_options(Mat product) {
  PetscFunctionBeginUser;
  const Mat_Product& its = *product->product;
  PetscCallCXX(product->ops->productsymbolic = choose_method(its));
  if (product->ops->productsymbolic != nullptr) PetscFunctionReturn(0);
  Method petsc = nullptr;
  PetscCallCXX(petsc = method_of(forms_galerkin_products_by_blocks(its.A) ? its.A : its.B, by_petsc));
  PetscCall((*petsc)(product));
  PetscFunctionReturn(0);
}

}  // namespace

bool forms_galerkin_products_by_blocks(Mat matrix) { return method_of(matrix, by_petsc) != nullptr; }
bool forms_symmetric_products(Mat matrix) { return method_of(matrix, symmetric) != nullptr; }

void form_galerkin_products_by_blocks(Mat matrix, bool is_symmetric) {
  if (forms_galerkin_products_by_blocks(matrix)) return;
  const auto object = reinterpret_cast<PetscObject>(matrix);
  // PETSc asks a matrix by name where the two of a product do not agree on whom to ask.
  POLYSLIP_PETSC(PetscObjectComposeFunction(object, by_petsc, matrix->ops->productsetfromoptions));
  for (const char* types : {sequential, parallel}) POLYSLIP_PETSC(PetscObjectComposeFunction(object, types, set_from_options));
  if (is_symmetric) POLYSLIP_PETSC(PetscObjectComposeFunction(object, symmetric, set_from_options));
  matrix->ops->productsetfromoptions = nullptr;
}

}  // namespace polyslip::la
