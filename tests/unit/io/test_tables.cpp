// history.csv, newton.csv and summary.json as interface.md promises them.
#include <gtest/gtest.h>

#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "polyslip/io/csv.hpp"
#include "polyslip/io/summary.hpp"
#include "temporary_directory.hpp"

namespace polyslip {
namespace {

std::string content(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

TEST(csv, counts_have_no_point_and_numbers_read_back_exactly) {
  const test::TemporaryDirectory directory(MPI_COMM_SELF);
  io::CsvTable table(directory.path() / "history.csv", {"step", "residual", "bound"});
  table.row({1, 0.1, -1e-300});
  table.row({12, 1.0 / 3.0, std::numeric_limits<double>::infinity()});
  EXPECT_EQ(content(directory.path() / "history.csv"), "step,residual,bound\n1,0.1,-1e-300\n12,0.3333333333333333,inf\n");
}

TEST(csv, rows_are_on_disk_while_the_table_is_open) {
  const test::TemporaryDirectory directory(MPI_COMM_SELF);
  io::CsvTable table(directory.path() / "t.csv", {"a"});
  table.row({7});
  EXPECT_EQ(content(directory.path() / "t.csv"), "a\n7\n");
}

TEST(csv, goes_on_behind_the_rows_of_an_earlier_run_up_to_a_step) {
  const test::TemporaryDirectory directory(MPI_COMM_SELF);
  const auto file = directory.path() / "t.csv";
  std::ofstream(file) << "step,a\n1,0.1\n2,0.30000000000000004\n2,7\n3,4\n2,un";  // the run was killed in its last row
  io::CsvTable(file, {"step", "a"}, 2).row({3, 5});
  EXPECT_EQ(content(file), "step,a\n1,0.1\n2,0.30000000000000004\n2,7\n3,5\n");
  io::CsvTable(file, {"step", "b", "a"}, 1).row({2, 8, 9});
  EXPECT_EQ(content(file), "step,b,a\n1,nan,0.1\n2,8,9\n") << "columns are known by name";
  io::CsvTable(directory.path() / "new.csv", {"step"}, 5).row({6});
  EXPECT_EQ(content(directory.path() / "new.csv"), "step\n6\n") << "there need not be an earlier run";
  io::CsvTable(file, {"step"}).row({1});
  EXPECT_EQ(content(file), "step\n1\n") << "or its rows may not be wanted";
}

TEST(csv, a_default_table_writes_nothing) {
  io::CsvTable table;
  EXPECT_NO_THROW(table.row({1, 2, 3}));
}

TEST(csv, a_missing_directory_is_named) {
  try {
    io::CsvTable table("/nowhere/at/all/t.csv", {"a"});
    FAIL() << "no exception";
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string(e.what()).find("/nowhere/at/all/t.csv"), std::string::npos) << e.what();
  }
}

io::Summary example() {
  io::Summary s;
  s.scene = "single_crack";
  s.version = "0.1.0";
  s.ranks = 2;
  s.mesh.cells = 3'000'000'000;
  s.newton.total = 9;
  s.errors.jump_tangential_l2 = 0.1125;
  s.extremes.max_slip = std::numeric_limits<double>::quiet_NaN();
  s.imbalance.cells = 1.02;
  s.kernels = {{"rock", "geometry", 0.5, 1e9, 2e8}};
  s.peak_memory_mb_per_rank = {12.5, 13};
  return s;
}

const std::vector<std::pair<std::string, std::vector<std::string>>>& promised_keys() {
  static const std::vector<std::pair<std::string, std::vector<std::string>>> keys = {
      {"scene", {}},
      {"version", {}},
      {"ranks", {}},
      {"status", {}},
      {"message", {}},
      {"build", {"petsc", "type"}},
      {"mesh", {"dimension", "cells", "faces", "nodes", "fracture_faces", "h_max", "h_min"}},
      {"dofs", {"displacement_nodal", "displacement_bubble", "multiplier", "pressure", "total", "solved"}},
      {"steps", {"accepted", "rejected"}},
      {"newton", {"total", "max_per_step"}},
      {"krylov", {"total", "max_per_solve"}},
      {"setups", {"preconditioner", "factorisation"}},
      {"active_set", {"open", "stick", "slip", "cycles_detected"}},
      {"balance", {"mass_error_max", "energy_violation_max"}},
      {"errors",
       {"displacement_l2", "gradient_l2", "multiplier_normal_l2", "multiplier_tangential_l2", "jump_normal_l2",
        "jump_tangential_l2", "pressure_l2", "flux_l2"}},
      {"extremes", {"max_slip", "max_opening", "min_pressure", "max_pressure", "mean_pressure"}},
      {"seconds", {"total", "read", "partition", "assemble", "condense", "solve", "write"}},
      {"imbalance", {"cells", "unknowns", "assembly"}},
      {"kernels", {"rock"}},
      {"peak_memory_mb_per_rank", {}},
      {"bytes_per_unknown", {}}};
  return keys;
}

TEST(summary, has_the_promised_keys_in_order_and_no_others) {
  const test::TemporaryDirectory directory(MPI_COMM_SELF);
  const auto file = directory.path() / "summary.json";
  io::write_summary(example(), file);
  const auto json = nlohmann::ordered_json::parse(content(file));
  ASSERT_EQ(json.size(), promised_keys().size());
  auto section = json.begin();
  for (const auto& [name, keys] : promised_keys()) {
    EXPECT_EQ(section.key(), name);
    std::vector<std::string> found;
    if (section->is_object()) {
      for (const auto& item : section->items()) found.push_back(item.key());
    }
    EXPECT_EQ(found, keys) << name;
    ++section;
  }
}

TEST(summary, absent_and_not_finite_numbers_are_null) {
  const test::TemporaryDirectory directory(MPI_COMM_SELF);
  const auto file = directory.path() / "summary.json";
  io::write_summary(example(), file);
  const auto json = nlohmann::json::parse(content(file));
  EXPECT_EQ(json["errors"]["jump_tangential_l2"], 0.1125);
  EXPECT_TRUE(json["errors"]["flux_l2"].is_null());
  EXPECT_TRUE(json["balance"]["mass_error_max"].is_null());
  EXPECT_TRUE(json["extremes"]["max_slip"].is_null());
  EXPECT_EQ(json["mesh"]["cells"], 3'000'000'000);
  EXPECT_EQ(json["peak_memory_mb_per_rank"], nlohmann::json({12.5, 13.0}));
  EXPECT_TRUE(json["bytes_per_unknown"].is_null()) << "there are no unknowns";
}

TEST(summary, bytes_per_unknown_are_those_of_all_ranks_over_all_unknowns) {
  io::Summary s = example();
  s.dofs.total = 1024;
  s.dofs.solved = 512;
  EXPECT_EQ(s.bytes_per_unknown(), 25.5 * 1024);
}

TEST(summary, replaces_an_older_one_and_leaves_nothing_else) {
  const test::TemporaryDirectory directory(MPI_COMM_SELF);
  const auto file = directory.path() / "summary.json";
  io::write_summary(example(), file);
  io::Summary second = example();
  second.status = "diverged";
  second.message = "broken byte \xff";
  io::write_summary(second, file);
  EXPECT_EQ(nlohmann::json::parse(content(file))["status"], "diverged");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory.path()), {}), 1);
}

TEST(summary, an_unwritable_place_is_named_with_the_reason) {
  try {
    io::write_summary(example(), "/nowhere/at/all/summary.json");
    FAIL() << "no exception";
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string(e.what()).find("/nowhere/at/all/summary.json: cannot write the file (No such file"), std::string::npos)
        << e.what();
  }
}

}  // namespace
}  // namespace polyslip
