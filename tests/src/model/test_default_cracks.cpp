// Precuts of scenarios that say nothing of nodes: the spacing that is derived at their fronts, what is said where the
// user's is coarse, and the volume of the opening.
#include "experiments/analytic/cracks.hpp"
#include "src/model/node_zone.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <fmt/format.h>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

namespace {

FineZone zone_of(const std::string& text) {
  const Scenario scenario = scenario_of(text);
  return fine_zone(scenario, *make_organ(scenario.organ).domain);
}

const std::string block_on_base = block_organ + held_below("0.001");

/// From the side at x = -0.03 m to `depth` inside, across the whole block.
std::string edge_cut(double depth, double beyond) {
  return rectangle_precut(fmt::format("[{}, 0, 0.015]", -0.03 + 0.5 * (depth - beyond)), "[0, 0, 1]", "[1, 0, 0]",
                          fmt::format("{}", 0.06 + 2 * beyond), fmt::format("{}", depth + beyond));
}

} // namespace

TEST_CASE("The derived spacing at the front of a precut is 0.15 of how far it reaches behind it, within a budget") {
  CHECK(zone_of(block_on_base + disc_precut).spacing.fine == Approx(0.15 * 0.01).epsilon(1e-12));
  for (const double beyond : {0.01, 0.2}) // whatever lies outside
    CHECK(zone_of(block_on_base + edge_cut(0.02, beyond)).spacing.fine == Approx(0.15 * 0.02).epsilon(0.05));
  CHECK(zone_of(block_on_base + edge_cut(0.02, 0.01)).spacing.fine ==
        zone_of(block_on_base + edge_cut(0.02, 0.2)).spacing.fine);
  // A buried square: half its side.
  CHECK(zone_of(block_on_base + rectangle_precut("[0, 0, 0.015]", "[0, 0, 1]", "[1, 0, 0]", "0.02", "0.02"))
            .spacing.fine == Approx(0.15 * 0.01).epsilon(0.05));
  // A cut of 1 mm along 60 mm: 0.15 mm would take some ten thousand nodes.
  const double shallow = zone_of(block_on_base + edge_cut(0.001, 0.01)).spacing.fine;
  CHECK(shallow > 1.5 * 0.15 * 0.001);
  CHECK(shallow < std::sqrt(0.001 * 0.06) / 6);
  CHECK(zone_of(block_on_base + disc_precut + "[cut]\nfront_spacing = 0.004\n").spacing.fine == 0.004);
}

TEST_CASE("Nodes too coarse for a precut are told, with place, ratio and the spacing that does") {
  const auto told = [](const std::string& text) {
    const Scenario scenario = scenario_of(text);
    const Organ organ = make_organ(scenario.organ);
    return coarse_front(scenario, *organ.domain, fine_zone(scenario, *organ.domain)).value_or("");
  };
  CHECK(told(block_on_base + disc_precut).empty());
  CHECK_THAT(told(block_on_base + disc_precut + "[cut]\nfront_spacing = 0.004\n"),
             Catch::Contains("precut[1]") && Catch::Contains("4 mm apart") &&
                 Catch::Contains("0.4 of its depth of 10 mm") && Catch::Contains("cut.front_spacing = 0.0015 m"));
}

TEST_CASE("The volume of an opening counts that faces part with the root of the distance from the front") {
  // With nodes 0.3 radii apart the written surface, flat from corner to corner, encloses 6 % too little.
  constexpr double radius = 0.01, pressure = 100;
  Session session = session_of("[organ]\nshape = \"block\"\nsize = [0.1, 0.1, 0.1]\n[material]\nyoung_modulus = 1e4\n"
                               "poisson_ratio = 0.3\n" +
                               held_below("0.001") +
                               "[[precut]]\nshape = \"disc\"\ncentre = [0.002, 0.001, 0.052]\nnormal = [0.2, 0.1, 1]\n"
                               "radius = 0.01\npressure = 100\n[cut]\nfront_spacing = 0.003\n");
  const CutReport cut = *run(session).back().cut;
  const double exact = experiments::penny_opening_volume(session.scenario().material, radius, pressure);
  CHECK(cut.opening_volume == Approx(exact).epsilon(0.02));
}

TEST_CASE("Two precuts nearer than two node distances are told, with distance, place and the spacing that does") {
  const auto told = [](const std::string& below, const std::string& more) {
    std::string found;
    const std::string text = block_on_base + disc_precut + replaced(disc_precut, "0.016]", below + "]") + more;
    const Session session = session_of(text);
    for (const std::string& warning : session.warnings())
      found += warning.find("precut[1] and precut[2]") != std::string::npos ? warning : "";
    return found;
  };
  const std::string enriched = "[cut]\nsight = \"enriched\"\n", fine = node_spacings("0.002", "0.002") + enriched;
  CHECK_THAT(told("0.013", fine), Catch::Contains("are 3 mm apart at [") && Catch::Contains("= 0.001 m put 3 between"));
  CHECK(told("0.011", fine).empty());
  CHECK(told("0.013", node_spacings("0.002", "0.002") + by_appending).empty());
  CHECK_FALSE(told("0.011", node_spacings("0.002", "0.012") + enriched).empty()); // coarser away from the fronts
  // Sheets that cross are one cut.
  std::string crossing;
  for (const char* normal : {"[1, 0, 0]", "[0, 1, 0]"})
    crossing += rectangle_precut("[0, 0, 0.03]", normal, "[0, 0, 1]", "0.02", "0.03");
  const Session crossed = session_of(cut_block + crossing + enriched);
  for (const std::string& warning : crossed.warnings())
    CHECK(warning.find("precut[2]") == std::string::npos);
}

TEST_CASE("The rotation about a front is told alike by both rules, wherever nodes happen to be") {
  std::vector<double> told;
  for (const std::string sight : {"enriched", "appended"}) {
    Session session =
        session_of(block_on_base + node_spacings("0.004", "0.008") + "[cut]\nsight = \"" + sight + "\"\n" +
                   rectangle_precut("[0, 0, 0.03]", "[1, 0, 0]", "[0, 0, 1]", "0.04", "0.03") + "pressure = 500\n");
    told.push_back(run(session).back().rotation_degrees);
  }
  CHECK(told[1] == Approx(told[0]).epsilon(0.25));
}
