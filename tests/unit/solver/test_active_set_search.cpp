#include <gtest/gtest.h>

#include <cstdio>
#include <memory>

#include "polyslip/la/vec_access.hpp"
#include "support/contact_scene.hpp"

namespace polyslip {
namespace {

using namespace tests;
using physics::ContactState;
using solver::ActiveSetTrace;
using solver::NewtonRecord;

class active_set_search : public testing::Test {
 protected:
  ContactScene scene_{[] { return fractured_box({2, "quads"}, 8, 0, 1); }, mixed_contact(2)};

  /// What SNESView prints for a Newton solver made under the options of now; empty on other ranks than 0.
  [[nodiscard]] std::string view() const {
    const std::unique_ptr<FILE, int (*)(FILE*)> file(std::tmpfile(), std::fclose);
    {
      const solver::ContactNewton newton(*scene_.system);
      la::Handle<PetscViewer> viewer;
      POLYSLIP_PETSC(PetscViewerASCIIOpenWithFILE(PETSC_COMM_WORLD, file.get(), viewer.put()));
      POLYSLIP_PETSC(SNESView(newton.snes(), viewer));
    }
    std::string text(100'000, '\0');
    std::rewind(file.get());
    text.resize(std::fread(text.data(), 1, text.size(), file.get()));
    return text;
  }
  [[nodiscard]] static std::string type_of(const solver::ContactNewton& newton) {
    SNESLineSearch search = nullptr;
    SNESLineSearchType type = nullptr;
    POLYSLIP_PETSC(SNESGetLineSearch(newton.snes(), &search));
    POLYSLIP_PETSC(SNESLineSearchGetType(search, &type));
    return type;
  }
  /// Records of all iterations from zero.
  static std::vector<NewtonRecord> iterate(ContactScene& scene) {
    std::vector<NewtonRecord> records;
    solver::ContactNewton newton(*scene.system);
    newton.monitor = [&](const NewtonRecord& record) { records.push_back(record); };
    EXPECT_TRUE(newton.solve(scene.x).converged);
    return records;
  }
  static double shortest(const std::vector<NewtonRecord>& records) {
    double alpha = 1;
    for (const auto& record : records) alpha = std::min(alpha, record.step_length);
    return alpha;
  }
};

TEST_F(active_set_search, is_the_type_unless_an_option_names_another) {
  EXPECT_EQ(type_of(solver::ContactNewton(*scene_.system)), solver::active_set_search);
  const ScopedOption other("-snes_linesearch_type", "basic");
  EXPECT_EQ(type_of(solver::ContactNewton(*scene_.system)), "basic");
}

TEST_F(active_set_search, can_be_named_by_an_option) {
  const ScopedOption type("-snes_linesearch_type", "activeset");
  EXPECT_EQ(type_of(solver::ContactNewton(*scene_.system)), "activeset");
}

TEST_F(active_set_search, shows_its_options_in_a_view) {
  const bool speaks = mpi::rank(PETSC_COMM_WORLD) == 0;
  std::string text = view();
  EXPECT_TRUE(!speaks || text.find("memory=5, decrease=0.0001, revisits=2") != std::string::npos) << text;
  const ScopedOption memory("-snes_linesearch_activeset_memory", "9"), decrease("-snes_linesearch_activeset_decrease", "0.25"),
      revisits("-snes_linesearch_activeset_revisits", "4");
  text = view();
  EXPECT_TRUE(!speaks || text.find("memory=9, decrease=0.25, revisits=4") != std::string::npos) << text;
}

TEST_F(active_set_search, takes_the_first_step_in_full) {
  const auto records = iterate(scene_);
  ASSERT_GT(records.size(), 2U);
  EXPECT_EQ(records[1].iteration, 1);
  EXPECT_EQ(records[1].step_length, 1);
}

TEST_F(active_set_search, shortens_steps_only_as_often_as_it_may) {
  // Friction that jams: one step must be halved here.
  const ScopedOption alone("-elimination_share", "0");
  ContactScene jammed([] { return fractured_box({2, "triangles"}, 12, 0, 1); }, mixed_contact(2, 2));
  EXPECT_EQ(shortest(iterate(jammed)), 0.5);
  POLYSLIP_PETSC(VecZeroEntries(jammed.x));
  const ScopedOption once("-snes_linesearch_max_it", "1");
  EXPECT_EQ(shortest(iterate(jammed)), 1);
}

/// States alternate between those of two vectors: all faces open, all faces stuck.
class active_set_trace : public active_set_search {
 protected:
  la::Handle<Vec> open_ = with_multiplier(-1), stuck_ = with_multiplier(1), slipping_ = with_multiplier(1, 5);
  ActiveSetTrace trace_;

  void SetUp() override {
    trace_.system = scene_.system.get();
    trace_.start(open_);
  }
  [[nodiscard]] la::Handle<Vec> with_multiplier(double normal, double tangential = 0) const {
    la::Handle<Vec> x = scene_.system->layout().create_vector();
    const la::VecWrite a(x);
    for (Index i = scene_.system->layout().multiplier_start(); i < scene_.system->layout().size(); i += 2) {
      a[i] = normal;
      a[i + 1] = tangential;
    }
    return x;
  }
  [[nodiscard]] long long faces() const { return scene_.system->fracture_faces(); }
};

TEST_F(active_set_trace, counts_states_and_the_faces_that_changed) {
  EXPECT_EQ(trace_.counts.faces[0], faces());
  trace_.advance(stuck_, 1, 2);
  EXPECT_EQ(trace_.counts.faces[1], faces());
  EXPECT_EQ(trace_.changed, faces());
  trace_.advance(stuck_, 1, 2);
  EXPECT_EQ(trace_.changed, 0);
}

TEST_F(active_set_trace, ends_a_cycle_of_period_two_at_the_second_revisit) {
  trace_.advance(stuck_, 1, 2);
  trace_.advance(open_, 1, 2);
  trace_.advance(stuck_, 1, 2);
  EXPECT_FALSE(trace_.cycle);
  trace_.advance(open_, 1, 2);
  EXPECT_TRUE(trace_.cycle);
  EXPECT_EQ(trace_.cycles, 1);
}

TEST_F(active_set_trace, ends_a_cycle_of_period_three) {
  for (int k = 0; k < 5; ++k) {
    EXPECT_FALSE(trace_.cycle) << k;
    trace_.advance(k % 3 == 0 ? stuck_ : k % 3 == 1 ? slipping_ : open_, 1, 2);
  }
  EXPECT_TRUE(trace_.cycle);
}

TEST_F(active_set_trace, sees_no_cycle_where_the_residual_falls) {
  double merit = 1;
  for (int k = 0; k < 12; ++k, merit /= 2.1)
    trace_.advance(k % 2 == 0 ? stuck_ : open_, merit, 2);  // two steps: less than a quarter
  EXPECT_FALSE(trace_.cycle);
}

TEST_F(active_set_trace, sees_no_cycle_in_states_that_stay_or_when_told_not_to_look) {
  for (int k = 0; k < 6; ++k) trace_.advance(stuck_, 1, 2);
  EXPECT_FALSE(trace_.cycle);
  for (int k = 0; k < 12; ++k) trace_.advance(k % 2 == 0 ? open_ : stuck_, 1, 0);
  EXPECT_FALSE(trace_.cycle);
}

TEST_F(active_set_trace, forgets_the_past_at_a_new_start) {
  trace_.advance(stuck_, 1, 2);
  trace_.advance(open_, 1, 2);
  trace_.start(open_);
  trace_.advance(stuck_, 1, 2);
  trace_.advance(open_, 1, 2);
  trace_.advance(stuck_, 1, 2);
  EXPECT_FALSE(trace_.cycle);
}

TEST_F(active_set_trace, names_the_faces_that_keep_changing) {
  EXPECT_EQ(trace_.flickering(), "");
  for (int k = 0; k < 4; ++k) trace_.advance(k % 2 == 0 ? stuck_ : open_, 1, 0);
  const std::string text = trace_.flickering();
  EXPECT_NE(text.find("upright at (0.5, "), std::string::npos) << text;
  EXPECT_NE(text.find("4 times"), std::string::npos) << text;
}

}  // namespace
}  // namespace polyslip
