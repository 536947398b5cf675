// Poses of a blade's way that are left out where it goes straight on.
#include "src/model/incision_builder.hpp"
#include "src/scenario/schedule.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <limits>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;
using topology::BladePose;

namespace {

const std::vector<Vector3> edge{{0, -0.01, 0}, {0, 0.01, 0.002}};
constexpr double tolerance = 1e-5; // m

std::vector<BladePose> way_of(int count, const std::function<BladePose(double)>& at) {
  std::vector<BladePose> way;
  for (int i = 1; i <= count; ++i) {
    way.push_back(at(static_cast<double>(i) / count));
    way.back().time = i;
  }
  return way;
}

BladePose at_place(const Vector3& position) {
  return {0, position, Eigen::Quaterniond::Identity()};
}

/// Farthest that the edge was at a pose of `way` from where it is on the straight ways between those kept.
double strays(const BladePose& from, const std::vector<BladePose>& way, const std::vector<BladePose>& kept) {
  double farthest = 0;
  for (const BladePose& pose : way) {
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < kept.size(); ++k)
      for (int i = 0; i <= 2000; ++i)
        nearest =
            std::min(nearest, edge_travel(edge, pose, pose_between(k == 0 ? from : kept[k - 1], kept[k], i / 2000.0)));
    farthest = std::max(farthest, nearest);
  }
  return farthest;
}

} // namespace

TEST_CASE("Of a straight way its end is kept, at any speed") {
  const BladePose from = at_place({0, 0, 0});
  const auto way = way_of(60, [](double s) { return at_place(s * s * Vector3(0.002, 0.001, -0.004)); });
  const auto kept = without_straight(edge, from, way, tolerance);
  REQUIRE(kept.size() == 1);
  CHECK(kept.back().position == way.back().position);
  CHECK(kept.back().time == way.back().time);
  CHECK(without_straight(edge, from, {way.front()}, tolerance).size() == 1);
  CHECK(without_straight(edge, from, {}, tolerance).empty());
}

TEST_CASE("Of a way that bends, turns or goes back as much is kept as the tolerance asks for, in its order") {
  const BladePose from = at_place({0, 0, 0});
  const std::vector<std::function<BladePose(double)>> ways{
      [](double s) {
        return at_place({0.004 * std::sin(3 * s), 0, 0.004 * (std::cos(3 * s) - 1)});
      },
      [](double s) { return at_place(s < 0.5 ? Vector3(0.004 * s, 0, 0) : Vector3(0.002, 0, 0.004 * (0.5 - s))); },
      [](double s) {
        return BladePose{0, {0.002 * s, 0, 0}, Eigen::Quaterniond(Eigen::AngleAxisd(0.8 * s, Vector3::UnitX()))};
      },
      [](double s) {
        return at_place({0.003 * std::sin(9 * s), 0, -0.001 * s});
      },
      [](double s) {
        return at_place({s < 0.7 ? 0.003 * s : 0.0021 - 0.02 * (s - 0.7), 0, 0});
      }, // past where it began
  };
  for (const auto& one : ways) {
    const auto way = way_of(150, one);
    const auto kept = without_straight(edge, from, way, tolerance);
    CHECK(kept.size() >= 2);
    CHECK(kept.size() <= 60);
    CHECK(kept.back().time == way.back().time);
    for (std::size_t k = 1; k < kept.size(); ++k)
      CHECK(kept[k].time > kept[k - 1].time);
    CHECK(strays(from, way, kept) <= 1.2 * tolerance); // the nearest of 2000 places between
  }
}

TEST_CASE("A long way costs no more than its length, and a pose that no sweep can take is not left out") {
  const BladePose from = at_place({0, 0, 0});
  auto way = way_of(100'000, [](double s) { return at_place({0.01 * s, 0, 0}); });
  const auto kept = without_straight(edge, from, way, tolerance);
  CHECK(kept.size() >= 2);
  CHECK(kept.size() <= way.size() / 60);
  way.resize(10);
  way[5].position.x() = std::numeric_limits<double>::quiet_NaN();
  const auto with_bad = without_straight(edge, from, way, tolerance);
  CHECK(std::count_if(with_bad.begin(), with_bad.end(),
                      [](const BladePose& x) { return std::isnan(x.position.x()); }) == 1);
}

TEST_CASE("A cut along poses that were put off has the triangles of its ends, and the area of them all") {
  const Scenario scenario = scenario_of(
      cut_block + "[blade]\nedge = [[0, -0.009, 0], [0, 0.009, 0.001]]\n[[blade.path]]\ntime = 0\nposition = [0, 0, "
                  "0.034]\n[[blade.path]]\ntime = 1\nposition = [0, 0, 0.02]\n");
  const auto domain = make_organ(scenario.organ).domain;
  const auto cut = [&](bool puts_off) {
    auto builder = std::make_unique<IncisionBuilder>(scenario, domain, 0.0025);
    for (int i = 0; i <= 100; ++i) {
      const BladePose pose{1e-2 * i, {0, 0, 0.034 - 1.4e-4 * i}, Eigen::Quaterniond::Identity()};
      if (puts_off && i % 20 != 0)
        builder->put_off(pose);
      else
        builder->move_to(pose, nullptr);
    }
    return builder;
  };
  const auto every = cut(false), some = cut(true);
  CHECK(some->incision()->area() == Approx(every->incision()->area()).epsilon(1e-6));
  CHECK(some->incision()->front_length() == Approx(every->incision()->front_length()).epsilon(1e-6));
  const auto triangles = [](const IncisionBuilder& builder) {
    return builder.incision()->sheets().front().triangles.size();
  };
  CHECK(4 * triangles(*some) < triangles(*every));
}

TEST_CASE("A way that was put off up to the blade's own place is cut, however many poses it has") {
  const Scenario scenario = scenario_of(
      cut_block + "[blade]\nedge = [[0, -0.009, 0], [0, 0.009, 0.001]]\n[[blade.path]]\ntime = 0\nposition = [0, 0, "
                  "0.034]\n[[blade.path]]\ntime = 1\nposition = [0, 0, 0.02]\n");
  const auto domain = make_organ(scenario.organ).domain;
  double area = 0;
  for (const int count : {1, 2, 63, 64, 65, 66, 129, 130, 131}) {
    IncisionBuilder builder(scenario, domain, 0.0025);
    BladePose pose{0, {0, 0, 0.034}, Eigen::Quaterniond::Identity()};
    builder.move_to(pose, nullptr);
    for (int i = 1; i <= count; ++i) {
      pose.time = i;
      pose.position.z() = 0.034 - 0.01 * i / count;
      builder.put_off(pose);
      builder.put_off(pose); // it rests there
    }
    CHECK(builder.move_to(pose, nullptr).triangles > 0);
    REQUIRE(builder.incision() != nullptr);
    area = area > 0 ? area : builder.incision()->area();
    // A motion below the sweep's smallest is left for the next one.
    const double least = topology::SweepOptions{}.minimum_step * 0.0025 * 0.018;
    CHECK(builder.incision()->area() <= area * (1 + 1e-9));
    CHECK(builder.incision()->area() >= area - 1.01 * least);
  }
}
