// A mesh part in pieces, for sending: its short fields as one run of bytes, long arrays as they are. Packer and Unpacker visit the same list of
// fields in the same order.
#pragma once

#include <cstddef>
#include <cstring>
#include <functional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "polyslip/mesh/distributed_mesh.hpp"

namespace polyslip::mesh {

/// Types sent as their bytes; Vec3 is three doubles but not trivially copyable by the letter.
template <class T>
constexpr bool sent_as_bytes = std::is_trivially_copyable_v<T> || std::is_same_v<T, Vec3>;

inline constexpr std::size_t longest_packed = 1 << 14;  ///< Bytes of an array; longer ones are not worth a copy.

class Packer {
 public:
  template <class T>
  void operator()(const T& value) {
    static_assert(sent_as_bytes<T>);
    append(std::as_bytes(std::span(&value, 1)));
  }
  template <class T>
  void operator()(const std::vector<T>& values) {
    static_assert(sent_as_bytes<T>);
    (*this)(values.size());
    const auto bytes = std::as_bytes(std::span(values));
    if (bytes.size() > longest_packed)
      arrays_.push_back(bytes);
    else
      append(bytes);
  }
  void operator()(const std::string& text) {
    (*this)(text.size());
    append(std::as_bytes(std::span(text)));
  }
  void operator()(const std::vector<std::string>& texts) {
    (*this)(texts.size());
    for (const auto& text : texts) (*this)(text);
  }
  [[nodiscard]] const std::vector<std::byte>& bytes() const { return bytes_; }
  [[nodiscard]] const std::vector<std::span<const std::byte>>& arrays() const { return arrays_; }  ///< The long ones, in the memory of what was packed.

 private:
  void append(std::span<const std::byte> bytes) { bytes_.insert(bytes_.end(), bytes.begin(), bytes.end()); }
  std::vector<std::byte> bytes_;
  std::vector<std::span<const std::byte>> arrays_;
};

class Unpacker {
 public:
  /// `fetch(bytes)` fills the next long array.
  Unpacker(std::vector<std::byte> bytes, std::function<void(std::span<std::byte>)> fetch) : bytes_(std::move(bytes)), fetch_(std::move(fetch)) {}

  template <class T>
  void operator()(T& value) {
    static_assert(sent_as_bytes<T>);
    take(&value, sizeof(T));
  }
  template <class T>
  void operator()(std::vector<T>& values) {
    static_assert(sent_as_bytes<T>);
    values.resize(take_size());
    const auto bytes = std::as_writable_bytes(std::span(values));
    if (bytes.size() > longest_packed)
      fetch_(bytes);
    else
      take(bytes.data(), bytes.size());
  }
  void operator()(std::string& text) {
    text.resize(take_size());
    take(text.data(), text.size());
  }
  void operator()(std::vector<std::string>& texts) {
    texts.resize(take_size());
    for (auto& text : texts) (*this)(text);
  }

 private:
  std::size_t take_size() {
    std::size_t size = 0;
    take(&size, sizeof(size));
    return size;
  }
  void take(void* to, std::size_t size) {
    if (size > 0) std::memcpy(to, bytes_.data() + read_, size);
    read_ += size;
  }
  std::vector<std::byte> bytes_;
  std::function<void(std::span<std::byte>)> fetch_;
  std::size_t read_ = 0;
};

template <class Archive, class Rows>
void visit_rows(Archive& archive, Rows& rows) {
  archive(rows.offsets);
  archive(rows.values);
}

template <class Archive, class Numbers>
void visit_numbering(Archive& archive, Numbers& numbers) {
  archive(numbers.owned);
  archive(numbers.first);
  archive(numbers.total);
  archive(numbers.ghosts);
}

template <class Archive, class Flow>
void visit_flow(Archive& archive, Flow& flow) {
  archive(flow.face_traces);
  visit_numbering(archive, flow.traces);
  archive(flow.trace_face);
  archive(flow.trace_input);
  visit_rows(archive, flow.fracture_ridges);
  visit_numbering(archive, flow.ridges);
  archive(flow.ridge_nodes);
  visit_rows(archive, flow.ridge_boundary_faces);
  archive(flow.ridge_input);
}

/// Every field of a part but its communicator. Part is DistributedMesh, const for a Packer.
template <class Archive, class Part>
void visit_fields(Archive& archive, Part& part) {
  auto& mesh = part.mesh;
  archive(mesh.dim);
  archive(mesh.nodes);
  visit_rows(archive, mesh.face_nodes);
  archive(mesh.face_cells);
  visit_rows(archive, mesh.cell_faces);
  archive(mesh.cell_region);
  archive(mesh.region_names);
  archive(mesh.face_tag);
  archive(mesh.tag_names);
  archive(mesh.face_fracture);
  archive(mesh.fracture_names);
  archive(mesh.fracture_length);
  archive(mesh.face_tip_distance);
  visit_rows(archive, mesh.cell_nodes);
  archive(mesh.cell_copies);
  archive(mesh.copy_node);
  archive(part.face_is_boundary);
  visit_numbering(archive, part.cells);
  visit_numbering(archive, part.copies);
  visit_numbering(archive, part.fractures);
  archive(part.fracture_faces);
  visit_flow(archive, part.flow);
  archive(part.cell_input);
  archive(part.copy_input);
  archive(part.fracture_face_input);
  archive(part.total_faces);
  archive(part.total_nodes);
}

}  // namespace polyslip::mesh
