// Checkpoints: read back to the bit on any number of ranks, refused when damaged, never half there.
#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <fstream>
#include <limits>
#include <numeric>

#include "polyslip/common/error.hpp"
#include "polyslip/common/mpi.hpp"
#include "polyslip/io/checkpoint.hpp"
#include "polyslip/io/checksum.hpp"
#include "temporary_directory.hpp"

namespace polyslip::io {
namespace {

const MPI_Comm world = MPI_COMM_WORLD;

/// The first n ranks; MPI_COMM_NULL on the others.
class FirstRanks {
 public:
  explicit FirstRanks(int n) {
    MPI_Comm_split(world, mpi::rank(world) < n ? 0 : MPI_UNDEFINED, mpi::rank(world), &comm_);
  }
  ~FirstRanks() {
    if (comm_ != MPI_COMM_NULL) MPI_Comm_free(&comm_);
  }
  FirstRanks(const FirstRanks&) = delete;
  FirstRanks& operator=(const FirstRanks&) = delete;
  operator MPI_Comm() const { return comm_; }  // NOLINT
  [[nodiscard]] bool has_me() const { return comm_ != MPI_COMM_NULL; }

 private:
  MPI_Comm comm_ = MPI_COMM_NULL;
};

/// Rows scattered over the ranks: number 3 i + 2 for i < n, dealt out from the last rank on.
std::vector<GlobalIndex> scattered(MPI_Comm comm, GlobalIndex n) {
  std::vector<GlobalIndex> numbers;
  for (GlobalIndex i = n - 1; i >= 0; --i) {
    if ((i * 7919 + i / 3) % mpi::size(comm) == mpi::rank(comm)) numbers.push_back(3 * i + 2);
  }
  return numbers;
}

/// A value that no text format carries whole, a different one for each row and column.
double value_of(GlobalIndex number, int column) { return (number % 2 != 0 ? -1.0 : 1.0) / (3.0 * number + column + 7.0); }

std::vector<double> values_of(const std::vector<GlobalIndex>& numbers, int columns) {
  std::vector<double> values;
  for (const GlobalIndex number : numbers) {
    for (int c = 0; c < columns; ++c) values.push_back(value_of(number, c));
  }
  return values;
}

CheckpointValues header(double time = 0.1) {
  return {{{"time", time}, {"step", 12}, {"largest step", std::numeric_limits<double>::infinity()}},
          {{"scene", "name: läuft\nsteps: 3\n" + std::string(100000, 'x')}, {"empty", ""}}};
}

void write(MPI_Comm comm, const std::filesystem::path& file, double time = 0.1) {
  const auto cells = scattered(comm, 100), ridges = scattered(comm, 5);
  const std::vector<CheckpointTable> tables{{"pressure", 1, cells, values_of(cells, 1)},
                                            {"displacement", 3, cells, values_of(cells, 3)},
                                            {"ridges", 2, ridges, values_of(ridges, 2)},
                                            {"nothing", 4, {}, {}}};
  write_checkpoint(comm, file, header(time), tables);
}

bool same_bits(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0);
}

void expect_content(MPI_Comm comm, const std::filesystem::path& file, double time = 0.1) {
  const Checkpoint checkpoint(comm, file);
  for (const auto& [name, value] : header(time).scalars) EXPECT_EQ(checkpoint.scalar(name), value);
  for (const auto& [name, text] : header(time).texts) EXPECT_EQ(checkpoint.text(name), text);
  const auto cells = scattered(comm, 100), ridges = scattered(comm, 5);
  EXPECT_TRUE(same_bits(checkpoint.rows("pressure", 1, cells), values_of(cells, 1)));
  EXPECT_TRUE(same_bits(checkpoint.rows("displacement", 3, cells), values_of(cells, 3)));
  EXPECT_TRUE(same_bits(checkpoint.rows("ridges", 2, ridges), values_of(ridges, 2)));
  EXPECT_TRUE(checkpoint.rows("nothing", 4, {}).empty());
  EXPECT_EQ(checkpoint.total_rows("pressure"), 100);
  EXPECT_EQ(checkpoint.total_rows("nothing"), 0);
}

/// The sentence with which a file is refused on every rank, "" if it is not.
std::string refusal(const std::filesystem::path& file) {
  try {
    const Checkpoint checkpoint(world, file);
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

/// Runs `change` on the first rank, the others waiting.
template <class Change>
void on_first_rank(Change&& change) {
  MPI_Barrier(world);
  if (mpi::rank(world) == 0) change();
  MPI_Barrier(world);
}

void flip_byte(const std::filesystem::path& file, std::uint64_t at) {
  std::fstream f(file, std::ios::in | std::ios::out | std::ios::binary);
  f.seekg(static_cast<std::streamoff>(at));
  const char byte = static_cast<char>(f.get() ^ 0x10);
  f.seekp(static_cast<std::streamoff>(at));
  f.put(byte);
}

#define EXPECT_SAYS(sentence, part) EXPECT_NE((sentence).find(part), std::string::npos) << (sentence)

TEST(checkpoint, reads_back_to_the_bit_what_was_written) {
  const test::TemporaryDirectory directory;
  write(world, directory.path() / "checkpoint.h5");
  expect_content(world, directory.path() / "checkpoint.h5");
}

TEST(checkpoint, is_read_on_another_number_of_ranks) {
  const test::TemporaryDirectory directory;
  for (int writers = 1; writers <= mpi::size(world); ++writers) {
    const auto file = directory.path() / ("written_by_" + std::to_string(writers) + ".h5");
    if (const FirstRanks some(writers); some.has_me()) write(some, file);
    for (int readers = 1; readers <= mpi::size(world); ++readers) {
      SCOPED_TRACE(std::to_string(writers) + " ranks write, " + std::to_string(readers) + " read");
      MPI_Barrier(world);
      if (const FirstRanks some(readers); some.has_me()) expect_content(some, file);
    }
  }
}

TEST(checkpoint, gives_every_rank_any_row_in_the_order_asked_for) {
  const test::TemporaryDirectory directory;
  write(world, directory.path() / "checkpoint.h5");
  const Checkpoint checkpoint(world, directory.path() / "checkpoint.h5");
  const std::vector<GlobalIndex> wanted{2, 299, 2, 2 + 3 * (10 + mpi::rank(world))};
  EXPECT_TRUE(same_bits(checkpoint.rows("displacement", 3, wanted), values_of(wanted, 3)));
}

TEST(checkpoint, keeps_the_bits_of_what_is_not_a_number) {
  const test::TemporaryDirectory directory;
  const std::vector<GlobalIndex> numbers{mpi::rank(world)};
  const std::vector<double> values{-0.0, std::numeric_limits<double>::denorm_min(), std::nan("77"),
                                   -std::numeric_limits<double>::infinity()};
  const std::vector<CheckpointTable> tables{{"odd", 4, numbers, values}};
  write_checkpoint(world, directory.path() / "c.h5", {}, tables);
  EXPECT_TRUE(same_bits(Checkpoint(world, directory.path() / "c.h5").rows("odd", 4, numbers), values));
}

TEST(checkpoint, refuses_a_file_with_one_byte_changed_wherever_it_is) {
  const test::TemporaryDirectory directory;
  const auto file = directory.path() / "checkpoint.h5";
  write(world, file);
  const auto size = std::filesystem::file_size(file);
  for (std::uint64_t at = 0; at < size; at += at < 1024 ? 97 : 9973) {
    SCOPED_TRACE("byte " + std::to_string(at));
    on_first_rank([&] { flip_byte(file, at); });
    const std::string sentence = refusal(file);
    EXPECT_SAYS(sentence, file.string());
    EXPECT_SAYS(sentence, "Restart ");
    if (at >= 512) {
      EXPECT_SAYS(sentence, "the checkpoint is damaged or cut short: 'bytes " + std::to_string(size));
    }
    on_first_rank([&] { flip_byte(file, at); });
  }
  expect_content(world, file);
}

TEST(checkpoint, refuses_a_file_that_is_cut_short_or_longer) {
  const test::TemporaryDirectory directory;
  const auto file = directory.path() / "checkpoint.h5";
  write(world, file);
  const auto size = std::filesystem::file_size(file);
  for (const std::uint64_t cut : {size + 1, size - 1, size / 2, std::uint64_t{512}}) {
    on_first_rank([&] { std::filesystem::resize_file(file, cut); });
    EXPECT_SAYS(refusal(file), "is damaged or cut short");
    EXPECT_SAYS(refusal(file), "but it has 'bytes " + std::to_string(cut));
  }
  on_first_rank([&] { std::filesystem::resize_file(file, 100); });
  EXPECT_SAYS(refusal(file), "cut short");
  on_first_rank([&] { std::filesystem::resize_file(file, 0); });
  EXPECT_SAYS(refusal(file), "not a checkpoint");
}

TEST(checkpoint, says_where_there_is_none) {
  EXPECT_SAYS(refusal("/nowhere/checkpoint.h5"), "/nowhere/checkpoint.h5: there is no checkpoint");
}

TEST(checkpoint, an_interrupted_write_leaves_the_old_one_whole) {
  const test::TemporaryDirectory directory;
  const auto file = directory.path() / "checkpoint.h5", part = directory.path() / "checkpoint.h5.part";
  write(world, file, 1.0);
  // What a kill leaves at any moment before the rename: a beginning of the file, without its head or with it.
  on_first_rank([&] {
    std::filesystem::copy_file(file, part);
    std::filesystem::resize_file(part, std::filesystem::file_size(file) / 2);
  });
  expect_content(world, file, 1.0);
  EXPECT_SAYS(refusal(part), "is damaged or cut short");
  on_first_rank([&] {
    std::fstream f(part, std::ios::in | std::ios::out | std::ios::binary);
    f << std::string(512, '\0');
  });
  EXPECT_SAYS(refusal(part), "writing it was not finished");

  write(world, file, 2.0);
  expect_content(world, file, 2.0);
  EXPECT_FALSE(std::filesystem::exists(part));
  expect_content(world, previous_checkpoint(file), 1.0);
}

TEST(checkpoint, a_damaged_one_offers_the_one_before_it) {
  const test::TemporaryDirectory directory;
  const auto file = directory.path() / "checkpoint.h5";
  write(world, file, 1.0);
  write(world, file, 2.0);
  on_first_rank([&] { std::filesystem::resize_file(file, 600); });
  EXPECT_SAYS(refusal(file), "-restart " + previous_checkpoint(file).string());
}

TEST(checkpoint, a_disk_that_refuses_leaves_the_old_one_whole_and_tells_all_ranks) {
  const test::TemporaryDirectory directory;
  const auto file = directory.path() / "checkpoint.h5";
  write(world, file, 1.0);
  on_first_rank([&] { std::filesystem::create_directory(directory.path() / "checkpoint.h5.part"); });
  EXPECT_THROW(write(world, file, 2.0), ResourceError);
  expect_content(world, file, 1.0);
}

TEST(checkpoint, names_what_it_lacks) {
  const test::TemporaryDirectory directory;
  write(world, directory.path() / "checkpoint.h5");
  const Checkpoint checkpoint(world, directory.path() / "checkpoint.h5");
  const auto sentence = [](auto&& body) -> std::string {
    try {
      body();
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_FALSE(checkpoint.has_scalar("slip"));
  EXPECT_FALSE(checkpoint.has_text("slip"));
  EXPECT_FALSE(checkpoint.has_table("slip"));
  EXPECT_TRUE(checkpoint.has_scalar("time") && checkpoint.has_text("scene") && checkpoint.has_table("ridges"));
  EXPECT_SAYS(sentence([&] { (void)checkpoint.scalar("slip"); }), "no number 'slip'");
  EXPECT_SAYS(sentence([&] { (void)checkpoint.text("slip"); }), "no text 'slip'");
  EXPECT_SAYS(sentence([&] { (void)checkpoint.rows("slip", 1, {}); }), "no table 'slip'");
  EXPECT_SAYS(sentence([&] { (void)checkpoint.rows("pressure", 2, {}); }), "no table 'pressure' of 2 columns (it has 1)");
  // Only the last rank asks for too much; all are told.
  const bool last = mpi::rank(world) == mpi::size(world) - 1;
  for (const GlobalIndex number : {3, 1'000'000}) {
    const std::vector<GlobalIndex> wanted{2, last ? number : 5};
    EXPECT_SAYS(sentence([&] { (void)checkpoint.rows("pressure", 1, wanted); }), "no row " + std::to_string(number));
  }
}

TEST(checkpoint, without_any_content_is_one_too) {
  const test::TemporaryDirectory directory;
  write_checkpoint(world, directory.path() / "c.h5", {}, {});
  const Checkpoint checkpoint(world, directory.path() / "c.h5");
  EXPECT_FALSE(checkpoint.has_scalar("time") || checkpoint.has_text("scene") || checkpoint.has_table("pressure"));
}

TEST(checksum, is_that_of_crc32_on_any_number_of_ranks) {
  const test::TemporaryDirectory directory;
  on_first_rank([&] { std::ofstream(directory.path() / "t") << "head123456789"; });
  EXPECT_EQ(file_checksum(world, directory.path() / "t", 4, 13), 0xcbf43926u);  // the check value of this CRC
  EXPECT_EQ(file_checksum(world, directory.path() / "t", 13, 13), 0u);
  EXPECT_THROW(file_checksum(world, directory.path() / "t", 4, 14), ResourceError);
}

}  // namespace
}  // namespace polyslip::io
