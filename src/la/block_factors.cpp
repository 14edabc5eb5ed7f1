#include "polyslip/la/block_factors.hpp"

#include <petscblaslapack.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "polyslip/common/mpi.hpp"
#include "polyslip/common/processor.hpp"
#include "polyslip/common/types.hpp"
#include "polyslip/la/aij_parts.hpp"
#include "polyslip/la/block_operator.hpp"
#include "polyslip/la/lanes.hpp"
#include "polyslip/la/rank_order.hpp"

namespace polyslip::la {

namespace {

/// Of A x = lambda B x with n x n entries, B positive definite; both are overwritten. By LAPACK: Eigen's takes the compiler a minute.
double smallest_eigenvalue(PetscBLASInt n, double* a, double* b) {
  const PetscBLASInt type = 1, room = 34 * n;
  std::vector<double> eigenvalues(static_cast<std::size_t>(n)), work(static_cast<std::size_t>(room));
  PetscBLASInt info = 0;
  LAPACKsygv_(&type, "N", "U", &n, a, &n, b, &n, eigenvalues.data(), work.data(), &room, &info);
  return info == 0 ? eigenvalues.front() : std::numeric_limits<double>::quiet_NaN();
}

/// The upper half of the bits of a float.
using Half = Eigen::bfloat16;

/// Vectors of the compilers (GCC's and Clang's), for what Eigen does number by number.
using Floats [[gnu::vector_size(16)]] = float;
using Halves [[gnu::vector_size(16)]] = std::uint16_t;

/// Of the first four of eight numbers.
Floats floats_of(const Half* values) {
  static_assert(std::endian::native == std::endian::little, "the lower half of a float is the first one here");
  Halves upper;
  Floats result;
  std::memcpy(&upper, values, sizeof upper);
  const Halves bits = __builtin_shufflevector(Halves{}, upper, 0, 8, 1, 9, 2, 10, 3, 11);
  std::memcpy(&result, &bits, sizeof result);
  return result;
}

/// The sums of each of four vectors.
Floats sums_of(const std::array<Floats, 4>& s) {
  const auto pairs = [](const Floats& v, const Floats& w) {
    return __builtin_shufflevector(v, w, 0, 4, 1, 5) + __builtin_shufflevector(v, w, 2, 6, 3, 7);
  };
  const Floats a = pairs(s[0], s[1]), c = pairs(s[2], s[3]);
  return __builtin_shufflevector(a, c, 0, 1, 4, 5) + __builtin_shufflevector(a, c, 2, 3, 6, 7);
}

/// Blocks of b x b entries, row by row. Nodes have turns: first the ghosts of ranks of lower colours, then the nodes of this rank that none
/// sees, which see no ghosts either, towards the border, then those that others see.
template <int b>
class FactorsOf final : public BlockFactors {
 public:
  FactorsOf(Mat matrix, PetscMPIInt tag, bool keeps_matrix) : exchange_(comm_of(matrix), tag) {
    const AijParts parts(matrix);
    PetscInt rows = 0;
    POLYSLIP_PETSC(MatGetLocalSize(matrix, &rows, nullptr));
    nodes_ = rows / b;
    const Numbering numbering = take_turns(matrix, parts, tag);
    find_lower(parts, numbering);
    const auto turns = static_cast<std::size_t>(end_);
    values_.resize(lower_.values.size() * size + beyond, Half(0));
    inverse_.resize(turns * size + beyond);
    is_damped_.resize(turns, 0);
    forward_.resize(turns * width);
    slot_.assign(turns, none);
    if (keeps_matrix) {
      find_across(parts, numbering);
      matrix_.resize(values_.size());
      diagonal_.resize(inverse_.size());
    }
  }

  bool factorise(Mat matrix) override {
    std::vector<Index> turns(static_cast<std::size_t>(nodes_));
    std::iota(turns.begin(), turns.end(), ghosts_);
    return factorise_rows(matrix, turns);
  }
  bool update(Mat matrix, const std::vector<PetscInt>& rows) override { return factorise_rows(matrix, turns_near(rows)); }

  void solve(const Values& r, Values& z) override {
    forward(ghosts_, border_, r);
    for (const Border& border : before_) receive_lanes(border, forward_, set);
    forward(border_, end_, r);
    for (Border& border : after_) send_lanes(border, forward_);
    exchange_.finish();  // the others wait for it, and it need not go on its way without this rank's help
    std::fill(z.begin(), z.end(), 0.0F);
    for (const Border& border : after_) receive_lanes(border, z, add);
    backward(border_, end_, z);
    for (Border& border : before_) send_lanes(border, z);
    exchange_.finish();
    backward(ghosts_, border_, z);
  }

  void multiply(const Values& x, Values& y) override {
    for (Border& border : seen_) send_lanes(border, x);
    for (Index i = ghosts_; i < end_; ++i) multiply_row(i, x, y);
    for (const Border& border : ghosts_of_) receive_lanes(border, ghost_values_, set);
    for (Index row = 0; row < across_.rows(); ++row) {
      Sums sums;
      for (Index t = across_.offsets[row]; t < across_.offsets[row + 1]; ++t)
        sums.add(at(matrix_across_, t, size), at(ghost_values_, across_.values[static_cast<std::size_t>(t)], width));
      lanes(at(y, border_ + row, width)) += sums.value();
    }
    exchange_.finish();
  }

  [[nodiscard]] Values zeros() const override { return Values(forward_.size()); }
  void gather(const PetscScalar* from, Values& to) const override {
    for (Index i = ghosts_; i < end_; ++i)
      for (int c = 0; c < b; ++c) at(to, i, width)[c] = static_cast<float>(from[node_at_[static_cast<std::size_t>(i)] * b + c]);
  }
  void scatter(const Values& from, PetscScalar* to) const override {
    for (Index i = ghosts_; i < end_; ++i)
      for (int c = 0; c < b; ++c) to[node_at_[static_cast<std::size_t>(i)] * b + c] = static_cast<double>(at(from, i, width)[c]);
  }
  [[nodiscard]] Eigen::Map<Eigen::ArrayXf> owned(Values& values) const override {
    return {at(values, ghosts_, width), static_cast<Eigen::Index>(nodes_) * width};
  }

  [[nodiscard]] int block() const override { return b; }
  [[nodiscard]] Index damped() const override { return static_cast<Index>(std::count(is_damped_.begin(), is_damped_.end(), 1)); }

 private:
  /// Of a node in memory: whole vectors of the processor, with zeros behind the components. Rows of blocks are read as such vectors, too, but
  /// stored without gaps: what follows them meets the zeros.
  static constexpr int width = b == 3 ? 4 : b == 6 ? 8 : b;
  static constexpr int size = b * b;
  static constexpr int beyond = 8;  ///< Numbers behind the last block that are read, too.
  static constexpr Index none = -1;
  static constexpr double least = 0.05;  ///< Of A_ii, left in D_i. Few pivots are as small, and to damp more costs iterations (a tenth of P1's with 0.2).
  using Block = Eigen::Matrix<double, b, b, Eigen::RowMajor>;
  using Lanes = Eigen::Array<float, width, 1>;
  using TransposedBlock = std::array<Lanes, b>;  ///< Its columns. Single precision is more than the factors are kept in.

  /// What this rank has in common with another one.
  struct Border {
    int rank = 0;
    std::vector<Index> turns;    ///< Nodes by their turns, or ghosts: of the rank that is eliminated first, or that a product needs.
    Csr entries;                 ///< Of ghosts: where each entry of their rows of L that is told has its place in L here, or `none`.
    std::vector<float> buffer;
  };

  /// Numbers of nodes over all ranks.
  struct Numbering {
    std::vector<GlobalIndex> of_turn, ghosts;  ///< `ghosts` ascending
    std::vector<Index> turn_of_ghost;          ///< `none` for those of later ranks.
    std::vector<Neighbour> neighbours;

    [[nodiscard]] Index turn_of(GlobalIndex ghost) const {
      const auto found = std::lower_bound(ghosts.begin(), ghosts.end(), ghost);
      return found == ghosts.end() || *found != ghost ? none : turn_of_ghost[static_cast<std::size_t>(found - ghosts.begin())];
    }
  };

  /// The rows of the matrix by turns.
  struct Entries {
    AijRows own;
    std::optional<AijRows> others;
    const PetscInt* global;
    const BlockOperator* lent;
    explicit Entries(const AijParts& parts) : own(parts.own), global(parts.global), lent(parts.lent) {
      if (parts.others != nullptr) others.emplace(parts.others);
    }
    [[nodiscard]] bool is_lent(Index node) const { return lent != nullptr && own.offsets()[node * b] == own.offsets()[(node + 1) * b]; }
  };
  /// Calls visit(turn, row in its block, column in its block, value) for the entries of a node that are eliminated before it, its own, and some
  /// others, but for those of later ghosts.
  template <class Visit>
  void visit(const Entries& entries, Index node, Visit&& visit) const {
    const auto visit_block = [&](Index column, const double* block, int) {
      const Index turn = turn_of_[static_cast<std::size_t>(column)];
      for (int r = 0; r < b; ++r)
        for (int c = 0; c < b; ++c) visit(turn, r, c, block[r * b + c]);
    };
    if (entries.is_lent(node)) {
      if (forwards_ && turn_of_[static_cast<std::size_t>(node)] < border_)
        entries.lent->template visit_lower<b>(node, visit_block);  // which lie behind one another in memory
      else
        entries.lent->template visit_own<b>(node, visit_block);
    }
    entries.own.visit(node * b, b, [&](PetscInt row, PetscInt column, PetscScalar value) {
      visit(turn_of_[static_cast<std::size_t>(column / b)], row % b, column % b, value);
    });
    if (!entries.others) return;
    entries.others->visit(node * b, b, [&](PetscInt row, PetscInt column, PetscScalar value) {
      const Index turn = turn_of_column_[static_cast<std::size_t>(column)];
      if (turn != none) visit(turn, row % b, entries.global[column] % b, value);
    });
  }

  template <class Real, class I>
  static Real* at(std::vector<Real>& values, I i, int n) {
    return values.data() + static_cast<std::size_t>(i) * static_cast<std::size_t>(n);
  }
  template <class Real, class I>
  static const Real* at(const std::vector<Real>& values, I i, int n) {
    return values.data() + static_cast<std::size_t>(i) * static_cast<std::size_t>(n);
  }
  static void store(const Block& block, std::vector<float>& values, Index i) {
    Eigen::Map<Eigen::Matrix<float, b, b, Eigen::RowMajor>>(at(values, i, size)) = block.template cast<float>();
  }
  template <class Real>
  static Real* node(Real* values, Index i) {
    return values + static_cast<std::ptrdiff_t>(i) * width;
  }
  static auto lanes(float* values) { return Eigen::Map<Lanes>(values); }
  static auto lanes(const float* values) { return Eigen::Map<const Lanes>(values); }
  static Lanes lanes(const Half* values) {
    Lanes result;
    if constexpr (width < 4) {
      for (int c = 0; c < width; ++c) result[c] = static_cast<float>(values[c]);
    } else {
      for (int c = 0; c < width; c += 4) put(floats_of(values + c), result, c);
    }
    return result;
  }
  static void put(const Floats& four, Lanes& values, int c) { std::memcpy(values.data() + c, &four, sizeof four); }
  /// Zeros behind the components.
  static Lanes components(const Lanes& values) {
    Lanes mask = Lanes::Zero();
    mask.template head<b>().setOnes();
    return values * mask;
  }
  /// Products of the rows of blocks with vectors, summed up by lanes.
  struct Sums {
    std::array<Lanes, b> lanes_of_row;
    Sums() { lanes_of_row.fill(Lanes::Zero()); }
    template <class Real>
    void add(const Real* block, const float* x) {
      const Lanes factor = lanes(x);
      for (int r = 0; r < b; ++r) lanes_of_row[r] += lanes(block + r * b) * factor;
    }
    [[nodiscard, gnu::always_inline]] Lanes value() const {
      Lanes y = Lanes::Zero();
      if constexpr (width < 4) {
        for (int r = 0; r < b; ++r) y[r] = lanes_of_row[r].sum();
      } else {  // four rows at once: one by one, through memory, took a sixth of a solve
        for (int r = 0; r < b; r += 4) put(sums_of({four(r), four(r + 1), four(r + 2), four(r + 3)}), y, r);
      }
      return y;
    }
    /// Of row r, its fours added up.
    [[nodiscard]] Floats four(int r) const {
      Floats sum{}, part;
      for (int c = 0; r < b && c < width; c += 4) {
        std::memcpy(&part, lanes_of_row[r].data() + c, sizeof part);
        sum += part;
      }
      return sum;
    }
  };

  Numbering take_turns(Mat matrix, const AijParts& parts, PetscMPIInt tag) {
    Numbering numbering;
    ghost_of_column_ = find_ghosts(parts, numbering);
    std::vector<Neighbour>& neighbours = numbering.neighbours;
    int colour = 0;
    if (parts.others != nullptr) {
      neighbours = find_neighbours(comm_of(matrix), nodes_, numbering.ghosts);
      colour = choose_colours(comm_of(matrix), tag, neighbours);
    }
    std::vector<char> is_seen(static_cast<std::size_t>(nodes_), 0);
    for (const Neighbour& n : neighbours)
      for (PetscInt node : n.nodes) is_seen[static_cast<std::size_t>(node)] = 1;
    PetscInt first = 0;
    POLYSLIP_PETSC(MatGetOwnershipRange(matrix, &first, nullptr));
    turn_of_.resize(static_cast<std::size_t>(nodes_));
    const auto append = [&](Index node, GlobalIndex number) {
      node_at_.push_back(node);
      numbering.of_turn.push_back(number);
      return static_cast<Index>(node_at_.size()) - 1;
    };
    append_ghosts(neighbours, colour, numbering, append);
    const auto append_own = [&](Index node, char seen) {
      if (is_seen[static_cast<std::size_t>(node)] == seen) turn_of_[static_cast<std::size_t>(node)] = append(node, first / b + node);
    };
    forwards_ = leads_to_border(parts, is_seen);
    for (Index k = 0; k < nodes_; ++k) append_own(forwards_ ? k : nodes_ - 1 - k, 0);
    border_ = static_cast<Index>(node_at_.size());
    for (Index node = 0; node < nodes_; ++node) append_own(node, 1);
    end_ = static_cast<Index>(node_at_.size());
    for (Index ghost : ghost_of_column_) turn_of_column_.push_back(numbering.turn_of_ghost[static_cast<std::size_t>(ghost)]);
    add_borders(neighbours, colour, numbering);
    return numbering;
  }

  /// Whether nodes that others see have their neighbours within before them rather than behind, in the order of the matrix. A node that is
  /// eliminated when those farther from the border are not yet fills in on both sides: up to three iterations more, of about 27.
  static bool leads_to_border(const AijParts& parts, const std::vector<char>& is_seen) {
    long long before = 0, behind = 0;
    const Entries entries(parts);
    for (Index node = 0; node < static_cast<Index>(is_seen.size()); ++node) {
      if (is_seen[static_cast<std::size_t>(node)] == 0) continue;
      const auto count = [&](Index j) {
        if (is_seen[static_cast<std::size_t>(j)] == 0) ++(j < node ? before : behind);
      };
      if (entries.is_lent(node)) entries.lent->template visit_own<b>(node, [&](Index j, const double*, int) { count(j); });
      entries.own.visit(node * b, 1, [&](PetscInt, PetscInt column, PetscScalar) { count(column / b); });
    }
    return before >= behind;
  }

  /// Returns the ghost of each column of the matrix of others.
  static std::vector<Index> find_ghosts(const AijParts& parts, Numbering& numbering) {
    std::vector<Index> ghost_of_column;
    PetscInt columns = 0;
    if (parts.others != nullptr) POLYSLIP_PETSC(MatGetSize(parts.others, nullptr, &columns));
    for (PetscInt k = 0; k < columns; ++k) {
      const PetscInt node = parts.global[k] / b;
      if (numbering.ghosts.empty() || numbering.ghosts.back() != node) numbering.ghosts.push_back(node);
      ghost_of_column.push_back(static_cast<Index>(numbering.ghosts.size()) - 1);
    }
    return ghost_of_column;
  }

  void add_borders(const std::vector<Neighbour>& neighbours, int colour, const Numbering& numbering) {
    for (const Neighbour& n : neighbours) {
      const bool is_before = n.colour < colour;
      const std::vector<PetscInt>& members = is_before ? n.ghosts : n.nodes;
      if (members.empty()) continue;
      Border& border = (is_before ? before_ : after_).emplace_back();
      border.rank = n.rank;
      for (PetscInt i : members) border.turns.push_back((is_before ? numbering.turn_of_ghost : turn_of_)[static_cast<std::size_t>(i)]);
    }
  }

  /// Ghosts of a colour by their numbers: the order in which their ranks eliminate them.
  template <class Append>
  void append_ghosts(const std::vector<Neighbour>& neighbours, int colour, Numbering& numbering, Append&& append) {
    std::vector<std::pair<int, PetscInt>> order;
    for (const Neighbour& n : neighbours)
      if (n.colour < colour)
        for (PetscInt ghost : n.ghosts) order.emplace_back(n.colour, ghost);
    std::sort(order.begin(), order.end());
    ghosts_ = static_cast<Index>(order.size());
    numbering.turn_of_ghost.assign(numbering.ghosts.size(), none);
    for (const auto& [its_colour, ghost] : order)
      numbering.turn_of_ghost[static_cast<std::size_t>(ghost)] = append(none, numbering.ghosts[static_cast<std::size_t>(ghost)]);
  }

  /// The pattern of L: where the matrix has blocks, and of ghosts what their ranks tell.
  void find_lower(const AijParts& parts, const Numbering& numbering) {
    const Entries entries(parts);
    std::vector<Index> seen(static_cast<std::size_t>(end_), none), columns;
    std::vector<std::vector<Index>> of_ghosts(static_cast<std::size_t>(ghosts_)), at_border(static_cast<std::size_t>(end_ - border_));
    const auto find_row = [&](Index i, std::vector<Index>& row) {
      row.clear();
      visit(entries, node_at_[static_cast<std::size_t>(i)], [&](Index j, PetscInt, PetscInt, PetscScalar) {
        if (j < i && std::exchange(seen[static_cast<std::size_t>(j)], i) != i) row.push_back(j);
      });
      std::sort(row.begin(), row.end());
    };
    lower_.offsets.reserve(static_cast<std::size_t>(end_) + 1);
    for (Index i = border_; i < end_; ++i) find_row(i, at_border[static_cast<std::size_t>(i - border_)]);
    exchange_patterns(numbering, at_border, of_ghosts);
    for (const std::vector<Index>& row : of_ghosts) lower_.push_row(row);
    for (Index i = ghosts_; i < border_; ++i) {
      find_row(i, columns);
      lower_.push_row(columns);
    }
    for (const std::vector<Index>& row : at_border) lower_.push_row(row);
    for (Border& border : before_)
      for (std::size_t k = 0; k < border.turns.size(); ++k)
        for (Index& place : border.entries[static_cast<Index>(k)])
          if (place != none) place += lower_.offsets[border.turns[k]];
  }

  /// The pattern of what products need of other ranks.
  void find_across(const AijParts& parts, const Numbering& numbering) {
    const Entries entries(parts);
    std::vector<Index> row;
    for (Index i = border_; i < end_; ++i) {
      row.clear();
      entries.others->visit(node_at_[static_cast<std::size_t>(i)] * b, b, [&](PetscInt, PetscInt column, PetscScalar) {
        row.push_back(ghost_of_column_[static_cast<std::size_t>(column)]);
      });
      std::sort(row.begin(), row.end());
      row.erase(std::unique(row.begin(), row.end()), row.end());
      across_.push_row(row);
    }
    matrix_across_.resize(across_.values.size() * size + beyond);
    ghost_values_.resize(numbering.ghosts.size() * width);
    for (const Neighbour& n : numbering.neighbours) {
      if (!n.nodes.empty()) {
        Border& border = seen_.emplace_back();
        border.rank = n.rank;
        for (PetscInt node : n.nodes) border.turns.push_back(turn_of_[static_cast<std::size_t>(node)]);
      }
      if (!n.ghosts.empty()) {
        Border& border = ghosts_of_.emplace_back();
        border.rank = n.rank;
        border.turns.assign(n.ghosts.begin(), n.ghosts.end());
      }
    }
  }

  /// Sends the rows at the border to later ranks (of each its size, and the numbers of its columns at the border) and takes those of ghosts,
  /// the columns that are ghosts here.
  void exchange_patterns(const Numbering& numbering, const std::vector<std::vector<Index>>& at_border,
                         std::vector<std::vector<Index>>& of_ghosts) {
    std::vector<std::vector<PetscInt>> messages(after_.size());
    for (std::size_t k = 0; k < after_.size(); ++k) {
      for (Index turn : after_[k].turns) {
        const std::vector<Index>& row = at_border[static_cast<std::size_t>(turn - border_)];
        messages[k].push_back(static_cast<PetscInt>(std::count_if(row.begin(), row.end(), [&](Index j) { return is_told(j); })));
        for (Index j : row)
          if (is_told(j)) messages[k].push_back(numbering.of_turn[static_cast<std::size_t>(j)]);
      }
      exchange_.send(after_[k].rank, messages[k]);
    }
    std::vector<PetscInt> message;
    for (Border& border : before_) {
      exchange_.receive(border.rank, message);
      auto next = message.begin();
      for (Index turn : border.turns) {
        std::vector<Index>& row = of_ghosts[static_cast<std::size_t>(turn)];
        std::vector<Index> places;
        for (PetscInt n = *next++; n > 0; --n) {
          const Index j = numbering.turn_of(*next++);
          places.push_back(j == none ? none : static_cast<Index>(row.size()));
          if (j != none) row.push_back(j);
        }
        border.entries.push_row(places);
      }
    }
    exchange_.finish();
  }

  /// Whether others may have column j of L: none sees the nodes within.
  [[nodiscard]] bool is_told(Index j) const { return j < ghosts_ || j >= border_; }

  /// D_j^{-1} and what is told of row j of L, for the ghosts of a rank.
  void receive_rows(Border& border) {
    exchange_.receive(border.rank, buffer_);
    const float* next = buffer_.data();
    for (std::size_t k = 0; k < border.turns.size(); ++k) {
      std::copy_n(next, size, at(inverse_, border.turns[k], size));
      next += size;
      for (Index place : border.entries[static_cast<Index>(k)]) {
        if (place != none) std::transform(next, next + size, at(values_, place, size), [](float entry) { return Half(entry); });
        next += size;
      }
    }
  }
  void send_rows(Border& border) {
    border.buffer.clear();
    const auto tell = [&](const auto* block) { border.buffer.insert(border.buffer.end(), block, block + size); };
    for (Index turn : border.turns) {
      tell(at(inverse_, turn, size));
      for (Index place = lower_.offsets[turn]; place < lower_.offsets[turn + 1]; ++place)
        if (is_told(lower_.values[static_cast<std::size_t>(place)])) tell(at(values_, place, size));
    }
    exchange_.send(border.rank, border.buffer);
  }
  void send_lanes(Border& border, const Values& values) {
    border.buffer.clear();
    for (Index turn : border.turns) border.buffer.insert(border.buffer.end(), at(values, turn, width), at(values, turn, width) + width);
    exchange_.send(border.rank, border.buffer);
  }

  static constexpr auto set = [](auto to, auto from) { to = from; };
  static constexpr auto add = [](auto to, auto from) { to += from; };
  /// Calls take(lanes here, lanes received) for each node of the border.
  template <class Take>
  void receive_lanes(const Border& border, Values& values, Take&& take) {
    exchange_.receive(border.rank, buffer_);
    for (std::size_t k = 0; k < border.turns.size(); ++k) take(lanes(at(values, border.turns[k], width)), lanes(at(buffer_, k, width)));
  }

  /// Nodes of some rows of the matrix, those below that have them in their rows of L, and those that have these, whatever ranks they are on.
  /// One step down is needed (without it, half as many iterations again, or divergence), and two as good as all.
  [[nodiscard]] std::vector<Index> turns_near(const std::vector<PetscInt>& rows) {
    constexpr Index reach = 2;
    std::vector<PetscInt> steps(static_cast<std::size_t>(end_), reach + 1), message;
    std::vector<Index> turns;
    for (const PetscInt row : rows) steps[static_cast<std::size_t>(turn_of_[static_cast<std::size_t>(row / b)])] = 0;
    const auto descend = [&](Index first, Index last) {
      for (Index i = first; i < last; ++i) {
        PetscInt& mine = steps[static_cast<std::size_t>(i)];
        for (const Index j : std::as_const(lower_)[i]) mine = std::min(mine, steps[static_cast<std::size_t>(j)] + 1);
        if (mine <= reach) turns.push_back(i);
      }
    };
    descend(ghosts_, border_);
    for (const Border& border : before_) {
      exchange_.receive(border.rank, message);
      for (std::size_t k = 0; k < message.size(); ++k) steps[static_cast<std::size_t>(border.turns[k])] = message[k];
    }
    descend(border_, end_);
    std::vector<std::vector<PetscInt>> messages;
    for (const Border& border : after_) {
      std::vector<PetscInt>& its = messages.emplace_back();
      for (const Index turn : border.turns) its.push_back(steps[static_cast<std::size_t>(turn)]);
    }
    for (std::size_t k = 0; k < messages.size(); ++k) exchange_.send(after_[k].rank, messages[k]);
    exchange_.finish();
    return turns;
  }

  /// Ascending turns. False, on all ranks, where an entry is not finite.
  bool factorise_rows(Mat matrix, const std::vector<Index>& turns) {
    for (bool updates : {true, false}) {
      updates_ = updates;
      if (!mpi::any(comm_of(matrix), !factorise_once(matrix, turns))) return true;
    }
    return false;
  }

  /// False where an entry is not finite, on this rank.
  bool factorise_once(Mat matrix, const std::vector<Index>& turns) {
    const AijParts parts(matrix);
    const Entries entries(parts);
    bool is_finite = true;
    auto turn = turns.begin();
    for (; turn != turns.end() && *turn < border_; ++turn) is_finite = factorise_row(entries, *turn) && is_finite;
    for (Border& border : before_) receive_rows(border);
    for (; turn != turns.end(); ++turn) is_finite = factorise_row(entries, *turn) && is_finite;
    for (Border& border : after_) send_rows(border);
    exchange_.finish();
    return is_finite;
  }

  bool factorise_row(const Entries& entries, Index i) {
    const std::span<const Index> lower = std::as_const(lower_)[i];
    const Index first = lower_.offsets[i];
    std::array<Eigen::Array<double, width, 1>, b> change;  // of D
    change.fill(Eigen::Array<double, width, 1>::Zero());
    TransposedBlock zero;
    zero.fill(Lanes::Zero());
    row_.assign(lower.size(), zero);  // W, at first A
    for (std::size_t s = 0; s < lower.size(); ++s) slot_[static_cast<std::size_t>(lower[s])] = static_cast<Index>(s);
    Block diagonal = Block::Zero();
    visit(entries, node_at_[static_cast<std::size_t>(i)], [&](Index j, PetscInt r, PetscInt c, PetscScalar value) {
      if (j < i)
        row_[static_cast<std::size_t>(slot_[static_cast<std::size_t>(j)])][static_cast<std::size_t>(c)][r] = static_cast<float>(value);
      else if (j == i)
        diagonal(r, c) = value;
    });
    if (!matrix_.empty()) keep_row(entries, i, diagonal);
    for (std::size_t s = 0; s < lower.size(); ++s) {
      const Index j = lower[s];
      TransposedBlock& w = row_[s];
      for (Index t = lower_.offsets[j]; updates_ && t < lower_.offsets[j + 1]; ++t) {
        const Index u = slot_[static_cast<std::size_t>(lower_.values[static_cast<std::size_t>(t)])];
        if (u != none) subtract_product(at(values_, t, size), row_[static_cast<std::size_t>(u)], w);
      }
      TransposedBlock l;
      l.fill(Lanes::Zero());
      subtract_product(at(inverse_, j, size), w, l);  // -L^T
      for (int c = 0; c < b; ++c)
        for (int r = 0; r < b; ++r) {
          at(values_, first + static_cast<Index>(s), size)[r * b + c] = static_cast<Half>(-l[c][r]);
          if (updates_) change[r] += (w[c][r] * l[c]).template cast<double>();
        }
    }
    for (const Index j : lower) slot_[static_cast<std::size_t>(j)] = none;
    Block d = diagonal;
    for (int r = 0; r < b; ++r) d.row(r) += change[r].template head<b>().matrix().transpose();
    return invert(diagonal, d, i);
  }

  /// w -= u l^T for w and u that are given transposed.
  template <class Real>
  static void subtract_product(const Real* l, const TransposedBlock& u, TransposedBlock& w) {
    for (int r = 0; r < b; ++r) {
      const Lanes factors = lanes(l + r * b);
      Lanes sum = w[r];
      for (int c = 0; c < b; ++c) sum -= factors[c] * u[c];
      w[r] = sum;
    }
  }

  /// Row i of the matrix: of its own nodes from `row_`, of ghosts from `entries`.
  void keep_row(const Entries& entries, Index i, const Block& diagonal) {
    store(diagonal, diagonal_, i);
    float* kept = at(matrix_, lower_.offsets[i], size);
    for (const TransposedBlock& block : row_)
      for (int r = 0; r < b; ++r)
        for (int c = 0; c < b; ++c) *kept++ = block[c][r];
    if (i < border_) return;
    const Index first = across_.offsets[i - border_], last = across_.offsets[i - border_ + 1];
    const auto columns = across_.values.begin();
    entries.others->visit(node_at_[static_cast<std::size_t>(i)] * b, b, [&](PetscInt row, PetscInt column, PetscScalar value) {
      const auto place = std::lower_bound(columns + first, columns + last, ghost_of_column_[static_cast<std::size_t>(column)]) - columns;
      at(matrix_across_, place, size)[(row % b) * b + entries.global[column] % b] = static_cast<float>(value);
    });
  }

  /// The inverse of D_i, where that is at least `least` A_ii in all directions; else of A_ii - omega (A_ii - D_i) with the largest omega for
  /// which this holds. Where A_ii is singular that of its diagonal, with 0 for empty rows: an aggregate with too few nodes for its modes leaves
  /// such behind, and nothing is restricted to them.
  bool invert(const Block& diagonal, const Block& d, Index i) {
    if (!d.allFinite()) return false;
    Block result;
    char& is_damped = is_damped_[static_cast<std::size_t>(i)] = 1;
    if (Eigen::LLT<Block>(diagonal).info() != Eigen::Success) {
      result = diagonal.diagonal().unaryExpr([](double a) { return a > 0 ? 1 / a : 0; }).asDiagonal();
    } else if (Eigen::LLT<Block>(d - least * diagonal).info() == Eigen::Success) {
      result = d.llt().solve(Block::Identity());
      is_damped = 0;
    } else {
      Block left = d, right = diagonal;
      const double omega = (1 - least) / (1 - smallest_eigenvalue(b, left.data(), right.data()));
      result = (diagonal - omega * (diagonal - d)).llt().solve(Block::Identity());
    }
    store(result, inverse_, i);
    return true;
  }

  /// (I + L) y = r, for rows that follow one another.
  POLYSLIP_BY_PROCESSOR void forward(Index first, Index last, const Values& r) {
    float* const y = forward_.data();
    for (Index i = first; i < last; ++i) {
      Sums sums;
      const Half* block = at(values_, lower_.offsets[i], size);
      prefetch(block, at(values_, lower_.offsets[i + 1], size));
      for (const Index j : std::as_const(lower_)[i]) {
        sums.add(block, node(y, j));
        block += size;
      }
      lanes(node(y, i)) = lanes(at(r, i, width)) - sums.value();
    }
  }

  /// D (I + L)^T z = y, and to the rows below what they lose by z_i; from the last row to the first.
  POLYSLIP_BY_PROCESSOR void backward(Index first, Index last, Values& z) {
    float* const values = z.data();
    for (Index i = last - 1; i >= first; --i) {
      Sums sums;
      sums.add(at(inverse_, i, size), at(forward_, i, width));
      const Lanes z_i = lanes(node(values, i)) + sums.value();
      lanes(node(values, i)) = z_i;
      const std::span<const Index> lower = std::as_const(lower_)[i];
      const Half* block = at(values_, lower_.offsets[i + 1], size);
      prefetch(at(values_, lower_.offsets[i], size), block, -two_pages);
      for (auto j = lower.rbegin(); j != lower.rend(); ++j) {  // downwards in memory throughout, for its prefetcher
        block -= size;
        lanes(node(values, *j)) -= transposed(block, z_i);
      }
    }
  }

  /// y_i = sum_{j<=i} A_ij x_j, and to the rows below what they get from x_i; ghosts left out.
  void multiply_row(Index i, const Values& x, Values& y) {
    Sums sums;
    sums.add(at(diagonal_, i, size), at(x, i, width));
    const Lanes x_i = lanes(at(x, i, width));
    const float* const from = x.data();
    float* const to = y.data();
    const float* block = at(matrix_, lower_.offsets[i], size);
    prefetch(block, at(matrix_, lower_.offsets[i + 1], size));
    for (const Index j : std::as_const(lower_)[i]) {
      if (j >= ghosts_) {
        sums.add(block, node(from, j));
        lanes(node(to, j)) += transposed(block, x_i);
      }
      block += size;
    }
    lanes(node(to, i)) = sums.value();
  }

  template <class Real>
  static Lanes transposed(const Real* block, const Lanes& x) {
    Lanes y = lanes(block) * x[0];
    for (int r = 1; r < b; ++r) y += lanes(block + r * b) * x[r];
    return components(y);
  }

  Index nodes_ = 0, ghosts_ = 0, border_ = 0, end_ = 0;
  bool forwards_ = true;  ///< Whether nodes within have their turns in the order of the matrix.
  bool updates_ = true;   ///< Whether rows above change those below.
  std::vector<Index> node_at_, turn_of_;  ///< Node by its turn, `none` for ghosts; and back.
  std::vector<Index> turn_of_column_;     ///< Of the matrix of others; `none` for ghosts of later ranks.
  Csr lower_;                             ///< Columns of L by turns.
  std::vector<Half> values_;              ///< L_ij, row by row
  std::vector<float> inverse_;            ///< D_i^{-1}
  std::vector<char> is_damped_;           ///< Whether omega_i < 1.
  Exchange exchange_;
  std::vector<Border> before_, after_;  ///< Ranks that are eliminated before and after this one.
  // Of the matrix, where it is kept.
  std::vector<float> matrix_, diagonal_;   ///< A_ij in the places of L_ij, without ghosts; A_ii
  Csr across_;                             ///< Ghosts of each node at the border.
  std::vector<float> matrix_across_;       ///< A_ij of these
  std::vector<Index> ghost_of_column_;     ///< Of the matrix of others.
  std::vector<Border> seen_, ghosts_of_;   ///< What other ranks see of this one, and this one of them.
  // Work space.
  std::vector<Index> slot_;
  std::vector<TransposedBlock> row_;
  std::vector<float> forward_, ghost_values_, buffer_;
};

}  // namespace

std::unique_ptr<BlockFactors> block_factors(Mat matrix, PetscMPIInt tag, bool keeps_matrix) {
  PetscInt block = 0;
  POLYSLIP_PETSC(MatGetBlockSize(matrix, &block));
  switch (block) {
    case 2: return std::make_unique<FactorsOf<2>>(matrix, tag, keeps_matrix);
    case 3: return std::make_unique<FactorsOf<3>>(matrix, tag, keeps_matrix);
    case 6: return std::make_unique<FactorsOf<6>>(matrix, tag, keeps_matrix);
    default: return std::make_unique<FactorsOf<1>>(matrix, tag, keeps_matrix);
  }
}

}  // namespace polyslip::la
