#include "polyslip/la/principal_submatrix.hpp"

#include <utility>

#include "polyslip/la/lanes.hpp"

namespace polyslip::la {

template <class Body>
void PrincipalSubmatrix::with_block(Body&& body) {
  switch (block_) {
    case 2: return body.template operator()<2>();
    case 3: return body.template operator()<3>();
    default: return body.template operator()<1>();
  }
}

void PrincipalSubmatrix::copy(const BlockOperator& whole, std::span<const Index> entities) {
  block_ = whole.block() > 0 ? whole.block() : 1;
  const auto nodes_before = [&](Index entity) { return whole.first(entity) / block_; };
  place_.assign(static_cast<std::size_t>(nodes_before(whole.local())), -1);
  Index places = 0;
  const auto place = [&](Index entity) {
    for (Index node = nodes_before(entity); node < nodes_before(entity + 1); ++node) place_[static_cast<std::size_t>(node)] = places++;
  };
  for (const Index entity : entities) place(entity);
  chosen_ = places;
  for (Index ghost = whole.owned(); ghost < whole.local(); ++ghost) place(ghost);
  ghosts_ = places - chosen_;

  columns_.offsets.assign(1, 0);
  columns_.values.clear();
  diagonal_.clear();
  mirrored_.clear();
  if (whole.block() > 0)
    with_block([&]<int b>() { copy_blocks<b>(whole, entities); });
  else
    copy_entries(whole, entities);
  const auto lanes = static_cast<std::size_t>(lanes_of(block_));
  x_.assign(static_cast<std::size_t>(chosen_ + ghosts_) * lanes, 0.0);
  y_.resize(static_cast<std::size_t>(chosen_) * lanes);
}

template <int b>
void PrincipalSubmatrix::copy_blocks(const BlockOperator& whole, std::span<const Index> entities) {
  std::size_t most = 0;
  for (const Index entity : entities) most += static_cast<std::size_t>(whole.blocks_held(entity));
  if (values_.size() < most * b * b + beyond_blocks) values_.resize(most * b * b + beyond_blocks);
  double* next = values_.data();
  for (const Index entity : entities) {
    const Index row = columns_.rows();
    const auto append = [&](Index other, const double* block, int) {
      const Index place = place_[static_cast<std::size_t>(other)];
      if (place < 0) return;
      if (place == row) diagonal_.push_back(static_cast<Index>(columns_.values.size()));
      columns_.values.push_back(place);
      copy_numbers<b * b>(block, next);
      next += b * b;
    };
    whole.by_halves() ? whole.visit_lower<b>(entity, append) : whole.visit_own<b>(entity, append);
    mirrored_.push_back(whole.by_halves() ? diagonal_.back() - columns_.offsets.back() : 0);
    whole.visit_ghosts(entity, append);
    columns_.offsets.push_back(static_cast<Index>(columns_.values.size()));
  }
}

/// By rows of single components.
void PrincipalSubmatrix::copy_entries(const BlockOperator& whole, std::span<const Index> entities) {
  values_.clear();
  for (const Index entity : entities)
    for (Index component = whole.first(entity); component < whole.first(entity + 1); ++component) {
      whole.visit_row(entity, [&](Index other, const double* block, int columns) {
        const double* values = block + static_cast<std::ptrdiff_t>(component - whole.first(entity)) * columns;
        for (int c = 0; c < columns; ++c) {
          const Index place = column(whole.first(other) + c);
          if (place < 0) continue;
          if (place == column(component)) diagonal_.push_back(static_cast<Index>(columns_.values.size()));
          columns_.values.push_back(place);
          values_.push_back(values[c]);
        }
      });
      mirrored_.push_back(0);
      columns_.offsets.push_back(static_cast<Index>(columns_.values.size()));
    }
  values_.resize(values_.size() + beyond_blocks);
}

void PrincipalSubmatrix::multiply(std::span<const double> x, std::span<double> y) {
  with_block([&]<int b>() {
    for (Index k = 0; k < chosen_ + ghosts_; ++k) copy_numbers<b>(x.data() + k * b, node<b>(x_.data(), k));
    multiply_rows<b>(y.data());
  });
}

template <int b>
void PrincipalSubmatrix::multiply_rows(double* y) {
  const double* block = values_.data();
  for (Index k = 0; k < chosen_; ++k) {
    multiply_row<b>(k, std::as_const(columns_)[k], mirrored_[static_cast<std::size_t>(k)], block, x_.data(), y_.data());
    block += static_cast<std::ptrdiff_t>(columns_.row_size(k)) * b * b;
  }
  for (Index k = 0; k < chosen_; ++k) copy_numbers<b>(node<b>(y_.data(), k), y + k * b);
}

std::vector<double> PrincipalSubmatrix::diagonal() const {
  std::vector<double> entries;
  for (const Index k : diagonal_)
    for (Index r = 0; r < block_; ++r) entries.push_back(values_[static_cast<std::size_t>((k * block_ + r) * block_ + r)]);
  return entries;
}

}  // namespace polyslip::la
