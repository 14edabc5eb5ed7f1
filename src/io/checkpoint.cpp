#include "polyslip/io/checkpoint.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <fstream>
#include <numeric>

#include "polyslip/common/error.hpp"
#include "polyslip/common/mpi.hpp"
#include "polyslip/io/atomic_file.hpp"
#include "polyslip/io/checksum.hpp"
#include "polyslip/io/hdf5.hpp"
#include "polyslip/la/handle.hpp"

namespace polyslip::io {

namespace {

static_assert(sizeof(PetscInt) == sizeof(GlobalIndex), "PETSc must be built with 32-bit indices");

constexpr std::size_t head_bytes = 512;
const std::string title = "polyslip checkpoint ", version = "1";
const std::string other_remedy = "Restart from another checkpoint, or run from the beginning without -restart";

std::string table_path(const std::string& name) { return "/tables/" + name; }
std::string text_path(const std::string& name) { return "/texts/" + name; }

/// First bytes of a file with this size and checksum.
std::string head(std::uint64_t size, std::uint32_t checksum) {
  std::string text = fmt::format("{}{}\nbytes {}\ncrc32 {:08x}\n", title, version, size, checksum);
  text.resize(head_bytes, '\0');
  return text;
}

/// What the head says of size and checksum, in one line.
std::string size_and_checksum(const std::string& head) {
  std::string text = head.substr(0, head.find('\0'));
  text.erase(0, text.find('\n') + 1);
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text.substr(0, text.find_last_not_of(' ') + 1);
}

/// Offers the checkpoint before a file, where there is one.
std::string remedy(const std::filesystem::path& file) {
  const std::filesystem::path previous = previous_checkpoint(file);
  std::error_code unreadable;
  if (!std::filesystem::exists(previous, unreadable)) return other_remedy;
  return fmt::format("Go on from the one before it: -restart {}", previous.string());
}

/// Gives the file, where it is there, a second name: the first one stays until a new file takes it.
void keep_as_previous(const std::filesystem::path& file) {
  if (!std::filesystem::exists(file)) return;
  const std::filesystem::path previous = previous_checkpoint(file);
  std::filesystem::remove(previous);
  std::error_code has_no_links;
  std::filesystem::create_hard_link(file, previous, has_no_links);
  if (has_no_links) std::filesystem::copy_file(file, previous);
}

/// Size of a file, known on all ranks.
std::uint64_t size_of(MPI_Comm comm, const std::filesystem::path& file) {
  std::uint64_t size = 0;
  mpi::on_root(comm, [&] { size = std::filesystem::file_size(file); });
  MPI_Bcast(&size, 1, MPI_UINT64_T, 0, comm);
  return size;
}

/// Each step is one collective call: where it fails on one rank, all leave together.
void write_content(MPI_Comm comm, const std::filesystem::path& file, const CheckpointValues& values,
                   std::span<const CheckpointTable> tables) {
  std::unique_ptr<H5File> out;
  mpi::together(comm, [&] { out = std::make_unique<H5File>(comm, file, H5File::Mode::create, head_bytes); });
  mpi::together(comm, [&] { out->create_group("/scalars"); });
  for (const auto& [name, value] : values.scalars) {
    mpi::together(comm, [&, &name = name, &value = value] { out->write_attribute("/scalars", name, value); });
  }
  for (const auto& [name, text] : values.texts) {
    mpi::together(comm, [&, &name = name, &text = text] { out->write_text(text_path(name), text); });
  }
  for (const CheckpointTable& table : tables) {
    assert(table.values.size() == table.numbers.size() * static_cast<std::size_t>(table.columns));
    const RowRange rows = RowRange::in_rank_order(comm, table.numbers.size());
    mpi::together(comm, [&] { out->write(table_path(table.name) + "/numbers", rows, 1, table.numbers); });
    mpi::together(comm, [&] { out->write(table_path(table.name) + "/values", rows, table.columns, table.values); });
  }
  mpi::together(comm, [&] { out->close(); });
}

/// Writes size and checksum into the head: until then the file does not pass for a checkpoint.
void seal(MPI_Comm comm, const std::filesystem::path& file) {
  const std::uint64_t size = size_of(comm, file);
  const std::uint32_t checksum = file_checksum(comm, file, head_bytes, size);
  mpi::on_root(comm, [&] {
    std::fstream out(file, std::ios::in | std::ios::out | std::ios::binary);
    out << head(size, checksum);
    out.close();
    if (!out) throw ResourceError(file.string() + ": cannot write the checksum. Check that the disk has room");
  });
}

void check_seal(MPI_Comm comm, const std::filesystem::path& file) {
  std::string written(head_bytes, '\0');
  mpi::on_root(comm, [&] {
    std::ifstream in(file, std::ios::binary);
    if (!in) throw InputError("there is no checkpoint that can be read", file.string(), remedy(file));
    in.read(written.data(), head_bytes);
    if (!written.starts_with(title)) {
      throw InputError("this is not a checkpoint, or writing it was not finished", file.string(), remedy(file));
    }
    if (!written.starts_with(title + version + "\n")) {
      throw InputError(fmt::format("the checkpoint is of another version than {}", version), file.string(),
                       "Restart with the program that wrote it, or run from the beginning without -restart");
    }
    if (!in) throw InputError("the checkpoint is cut short: its head is not complete", file.string(), remedy(file));
  });
  written = mpi::broadcast(comm, written);
  const std::uint64_t size = size_of(comm, file);
  const std::string found = head(size, file_checksum(comm, file, head_bytes, size));
  if (found != written) {
    throw InputError(fmt::format("the checkpoint is damaged or cut short: '{}' were written, but it has '{}'",
                                 size_and_checksum(written), size_and_checksum(found)),
                     file.string(), remedy(file));
  }
}

/// Leaves on this rank, roots in contiguous ranges of `owned` a rank.
la::Handle<PetscSF> graph(MPI_Comm comm, PetscInt owned, std::span<const GlobalIndex> leaves) {
  la::Handle<PetscSF> sf;
  PetscLayout layout = nullptr;
  POLYSLIP_PETSC(PetscLayoutCreateFromSizes(comm, owned, PETSC_DETERMINE, 1, &layout));
  POLYSLIP_PETSC(PetscSFCreate(comm, sf.put()));
  POLYSLIP_PETSC(
      PetscSFSetGraphLayout(sf, layout, static_cast<PetscInt>(leaves.size()), nullptr, PETSC_COPY_VALUES, leaves.data()));
  POLYSLIP_PETSC(PetscLayoutDestroy(&layout));
  return sf;
}

template <class T>
void fetch(PetscSF sf, MPI_Datatype type, const std::vector<T>& roots, std::vector<T>& leaves) {
  POLYSLIP_PETSC(PetscSFBcastBegin(sf, type, roots.data(), leaves.data(), MPI_REPLACE));
  POLYSLIP_PETSC(PetscSFBcastEnd(sf, type, roots.data(), leaves.data(), MPI_REPLACE));
}

/// Where the wanted numbers stand among the rows of all ranks, -1 for nowhere. The ranks that hold rows and those that want them
/// meet at a directory that is shared out by number.
std::vector<GlobalIndex> places(MPI_Comm comm, std::span<const GlobalIndex> held, std::span<const GlobalIndex> wanted) {
  long long last = -1;
  for (const auto& numbers : {held, wanted}) {
    for (const GlobalIndex number : numbers) last = std::max<long long>(last, number);
  }
  const RowRange mine = RowRange::even(comm, static_cast<hsize_t>(mpi::max(comm, last) + 1));
  std::vector<GlobalIndex> directory(mine.count, -1), rows(held.size()), result(wanted.size(), -1);
  std::iota(rows.begin(), rows.end(), static_cast<GlobalIndex>(mpi::exclusive_sum(comm, static_cast<long long>(held.size()))));
  const auto owned = static_cast<PetscInt>(mine.count);
  const auto enter = graph(comm, owned, held);
  POLYSLIP_PETSC(PetscSFReduceBegin(enter, MPIU_INT, rows.data(), directory.data(), MPI_REPLACE));
  POLYSLIP_PETSC(PetscSFReduceEnd(enter, MPIU_INT, rows.data(), directory.data(), MPI_REPLACE));
  fetch(graph(comm, owned, wanted), MPIU_INT, directory, result);
  return result;
}

}  // namespace

std::filesystem::path previous_checkpoint(const std::filesystem::path& file) {
  return file.parent_path() / (file.stem().string() + ".previous" + file.extension().string());
}

void write_checkpoint(MPI_Comm comm, const std::filesystem::path& file, const CheckpointValues& values,
                      std::span<const CheckpointTable> tables) {
  std::filesystem::path part = file;
  part += ".part";
  write_content(comm, part, values, tables);
  seal(comm, part);
  mpi::on_root(comm, [&] {
    sync_to_disk(part);
    keep_as_previous(file);
    std::filesystem::rename(part, file);
    sync_to_disk(std::filesystem::absolute(file).parent_path());
  });
}

Checkpoint::Checkpoint(MPI_Comm comm, const std::filesystem::path& file) : comm_(comm), name_(file.string()) {
  check_seal(comm, file);
  mpi::together(comm, [&] { file_ = std::make_unique<H5File>(comm, file, H5File::Mode::read); });
}

Checkpoint::~Checkpoint() = default;

bool Checkpoint::has_scalar(const std::string& name) const { return file_->has_attribute("/scalars", name); }
bool Checkpoint::has_text(const std::string& name) const { return file_->has("/texts") && file_->has(text_path(name)); }
bool Checkpoint::has_table(const std::string& name) const { return file_->has("/tables") && file_->has(table_path(name)); }

void Checkpoint::need(bool there, const std::string& what) const {
  if (!there) throw InputError("the checkpoint has no " + what + ": it is of another kind of run", name_, other_remedy);
}

double Checkpoint::scalar(const std::string& name) const {
  need(has_scalar(name), "number '" + name + "'");
  return file_->read_attribute("/scalars", name);
}

std::string Checkpoint::text(const std::string& name) const {
  need(has_text(name), "text '" + name + "'");
  return file_->read_text(text_path(name));
}

GlobalIndex Checkpoint::total_rows(const std::string& table) const {
  need(has_table(table), "table '" + table + "'");
  return static_cast<GlobalIndex>(file_->shape(table_path(table) + "/values").first);
}

std::vector<double> Checkpoint::rows(const std::string& table, int columns, std::span<const GlobalIndex> numbers) const {
  need(has_table(table), "table '" + table + "'");
  const auto [total, found] = file_->shape(table_path(table) + "/values");
  need(found == columns, fmt::format("table '{}' of {} columns (it has {})", table, columns, found));
  const RowRange share = RowRange::even(comm_, total);
  std::vector<GlobalIndex> held;
  std::vector<double> values, result(numbers.size() * static_cast<std::size_t>(columns));
  mpi::together(comm_, [&] { held = file_->read_integers(table_path(table) + "/numbers", share); });
  mpi::together(comm_, [&] { values = file_->read_doubles(table_path(table) + "/values", share); });

  const std::vector<GlobalIndex> where = places(comm_, held, numbers);
  mpi::together(comm_, [&] {
    const auto missing = std::find(where.begin(), where.end(), -1) - where.begin();
    if (missing == static_cast<std::ptrdiff_t>(where.size())) return;
    throw InputError(fmt::format("the table '{}' of the checkpoint has no row {}: it is of another mesh", table, numbers[missing]),
                     name_, other_remedy);
  });
  fetch(graph(comm_, static_cast<PetscInt>(share.count), where), mpi::BlockType(MPI_DOUBLE, columns), values, result);
  return result;
}

}  // namespace polyslip::io
