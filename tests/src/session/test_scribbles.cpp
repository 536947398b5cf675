// Scribbles of a scalpel over a live block, as a hand that wants to see what happens draws them: straight strokes to
// and fro across one another, some of them without lifting the blade between. SPHERECUT_SCRIBBLES blocks (2) from the
// seed SPHERECUT_SCRIBBLES_FIRST (1) on, SPHERECUT_SCRIBBLES_EACH scribbles (1) in each. Odd seeds: the body follows in
// the step; even ones: it is made in the background. Processor time is printed, never judged; work is, by a count of
// the sight lines that had to go through all triangles. SPHERECUT_SCRIBBLES_SIGHT names a cut.sight in place of the
// method's own; SPHERECUT_SCRIBBLES_LIVER=1 draws over the live liver in place of the block.
#include "solvers/algebra/parallel.hpp"
#include "src/live/simulation.hpp"
#include "src/live/surface_follower.hpp"
#include "topology/incision/sight_work.hpp"
#include "topology/wound/splinters.hpp"

#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <numbers>
#include <random>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

namespace {

int scribble_setting(const char* name, int otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::stoi(text);
}

double scribble_processor_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

const bool on_liver = std::getenv("SPHERECUT_SCRIBBLES_LIVER") != nullptr;
constexpr double block_half_side = 0.03;          // m, of the block
const double organ_top = on_liver ? 0.053 : 0.03; // m; of the liver about the middle of the field
const double field_middle = on_liver ? -0.02 : 0; // m, in x

// Stretched, so that cuts gape; a scalpel with the belly of the one of the live liver.
const std::string scribbled_block = stretched(cut_block) + R"([blade]
edge = [[0, 0, 0], [0.010, 0, 0.007], [0.022, 0, 0.024]]
edge_radius = 0.0001
[[blade.path]]
time = 0
position = [0, 0, 0.05]
[[blade.path]]
time = 1
position = [0, 0, 0.045]
)";

struct HandPoint {
  Vector3 at;     // m, of the tip
  double heading; // rad
  bool cuts;      // on the way here the tip is in the tissue
  int stroke;     // counted from 0; -1: between strokes
};

// The way of the hand, a point every so often; 4 ms from one to the next.
class ScribblingHand {
 public:
  explicit ScribblingHand(unsigned seed) : random_(seed) {}

  double between(double low, double high) {
    return low + (high - low) * (static_cast<double>(random_()) / std::mt19937::max());
  }

  std::vector<HandPoint> scribbles(int count) {
    for (int s = 0; s < count; ++s) {
      const Eigen::Vector2d middle{field_middle + between(-0.012, 0.012), between(-0.012, 0.012)};
      const int strokes = 2 + static_cast<int>(between(0, 5)); // two to six
      double angle = between(0, 2 * std::numbers::pi);
      for (int k = 0; k < strokes; ++k) {
        const double length = between(0.012, 0.04), depth = between(0.003, 0.014);
        const Eigen::Vector2d along{std::cos(angle), std::sin(angle)},
            off = middle + Eigen::Vector2d(between(-0.006, 0.006), between(-0.006, 0.006));
        draw(inside(off - 0.5 * length * along), inside(off + 0.5 * length * along), organ_top - depth,
             k == 0 || between(0, 1) < 0.6);
        angle += between(0.3, 0.7) * 2 * std::numbers::pi;
      }
    }
    lift();
    return std::move(way_);
  }

 private:
  static Eigen::Vector2d inside(const Eigen::Vector2d& x) {
    return on_liver ? x : Eigen::Vector2d(x.cwiseMin(0.8 * block_half_side).cwiseMax(-0.8 * block_half_side));
  }
  // Straight on, the blade turning into its way as a hand turns it.
  void go(const Vector3& to, bool cuts, int stroke) {
    constexpr double step = 0.0004; // m: 0.1 m/s
    const Vector3 from = way_.empty() ? to : way_.back().at, way = to - from;
    const int steps = std::max(1, static_cast<int>(std::ceil(way.norm() / step)));
    for (int i = 1; i <= steps; ++i) {
      const Vector3 x = from + way * i / steps;
      if (Eigen::Vector2d(way.x(), way.y()).norm() > 1e-6) {
        const double turn = std::remainder(std::atan2(way.y(), way.x()) - heading_, 2 * std::numbers::pi);
        heading_ += std::abs(turn) < 1.9 || !cuts ? turn * (1 - std::exp(-way.norm() / steps / 0.003)) : 0;
      }
      way_.push_back({x, heading_, cuts, stroke});
    }
  }
  void lift() { go({way_.back().at.x(), way_.back().at.y(), organ_top + 0.02}, true, -1); }
  void draw(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double z, bool anew) {
    if (anew) {
      if (!way_.empty())
        lift();
      heading_ = std::atan2(to.y() - from.y(), to.x() - from.x());
      go({from.x(), from.y(), organ_top + 0.02}, false, -1);
      go({from.x(), from.y(), z}, true, -1);
    } else {
      go({from.x(), from.y(), z}, true, -1);
    }
    go({to.x(), to.y(), z}, true, stroke_++);
  }

  std::mt19937 random_;
  std::vector<HandPoint> way_;
  double heading_ = 0;
  int stroke_ = 0;
};

Scenario scribbled_scenario() {
  std::string text = scribbled_block;
  if (on_liver) {
    std::ifstream file(std::filesystem::path(SPHERECUT_SOURCE_DIR) / "scenarios" / "liver_live.toml");
    text.assign(std::istreambuf_iterator<char>(file), {});
  }
  if (const char* sight = std::getenv("SPHERECUT_SCRIBBLES_SIGHT"); sight != nullptr)
    text = on_liver ? replaced(text, "sight = \"appended\"", "sight = \"" + std::string(sight) + "\"")
                    : text + "[cut]\nsight = \"" + std::string(sight) + "\"\n";
  return scenario_of(text);
}

struct Scribbled {
  int solves = 0, cuts = 0, refused = 0, failed = 0, strokes = 0, pieces = 1, crumbs = 0;
  double area = 0;                    // m2
  double front = 0;                   // m
  double swept = 0;                   // m2, by the edge below the block's top, were the tissue at rest
  std::vector<double> seconds;        // of processor time, of increments
  double worst_solve = 0;             // s of processor time, of all solves
  std::uint64_t most_lines = 0;       // walked through the tree of triangles in an increment
  std::map<std::string, int> reasons; // of refusals and failures
};

Scribbled scribble(unsigned seed, int each) {
  CAPTURE(seed);
  Scribbled out;
  ScribblingHand hand(seed);
  const std::vector<HandPoint> way = hand.scribbles(each);
  const bool in_background = seed % 2 == 0;
  HapticSimulation simulation(scribbled_scenario());
  const Session& session = simulation.session();
  const double whole = topology::volume(session.organ().domain->surface());
  const double least = session.zone().spacing.fine; // m
  DeviceState device;
  device.mode = static_cast<std::uint16_t>(HandMode::blade);
  const auto pose = [&](std::size_t tick) {
    const HandPoint& point = way[std::min(tick, way.size() - 1)];
    device.tick = tick;
    device.time = 4e-3 * static_cast<double>(tick);
    device.position = point.at;
    device.orientation = Eigen::AngleAxisd(point.heading, Vector3::UnitZ());
  };
  for (std::size_t i = 1; i < way.size(); ++i)
    if (way[i].stroke >= 0)
      out.swept += (way[i].at - way[i - 1].at).norm() * (organ_top - way[i].at.z());
  pose(0);
  simulation.prepare(device);
  SolveEvent event;
  event.in_background = in_background;
  ContactSnapshot snapshot;
  std::size_t next = 0;
  double area = 0;
  const std::size_t last = way.size() + 1500; // the hand rests outside; what has been put off is made
  for (std::size_t tick = 0; tick <= last; ++tick) {
    pose(tick);
    if (tick < next) {
      simulation.pass(device);
      continue;
    }
    next = tick + static_cast<std::size_t>(hand.between(5, 60)); // 20 to 240 ms
    event.sequence += 1;
    event.pose_tick = tick;
    event.swaps = session.pending().under_way && hand.between(0, 1) < 0.5;
    const double begin = scribble_processor_seconds();
    const std::uint64_t lines = topology::sight_lines_walked();
    const SolveRecord record = solve_recording(simulation, device, event, snapshot);
    const double spent = scribble_processor_seconds() - begin;
    out.worst_solve = std::max(out.worst_solve, spent);
    out.solves += 1;
    CAPTURE(tick, record.reason);
    if (record.failed) {
      out.failed += 1;
      CHECK_FALSE(record.reason.empty());
      out.reasons[record.reason] += 1;
      continue;
    }
    const auto& cut = simulation.result().cut;
    if (!cut)
      continue;
    if (cut->refused) {
      out.refused += 1;
      CHECK_FALSE(cut->reason.empty());
      out.reasons[cut->reason] += 1;
    }
    if (cut->triangles > 0) {
      out.cuts += 1;
      out.seconds.push_back(spent);
      out.most_lines = std::max(out.most_lines, topology::sight_lines_walked() - lines);
      if (std::getenv("SPHERECUT_SCRIBBLES_EACH_INCREMENT") != nullptr)
        std::cout << "  tick " << tick << " " << 1e4 * cut->area << " cm2 front " << 1e2 * cut->front_length
                  << " cm sheets " << cut->sheets << " nodes " << cut->nodes << " kept " << cut->kept_nodes << " "
                  << to_string(cut->update) << " (" << cut->update_reason << ") topology " << cut->seconds.topology
                  << " levels " << cut->seconds.level_sets << " sight " << cut->seconds.visibility << " sprinkling "
                  << cut->seconds.sprinkling << " assembly " << cut->seconds.assembly << " solve " << cut->seconds.solve
                  << " cpu " << spent << "\n"
                  << std::flush;
      const topology::Wound& wound = *session.wound();
      CHECK_FALSE(topology::manifold_defect(wound.surface).has_value());
      double volume = 0;
      for (const auto& piece : wound.pieces)
        volume += piece.volume;
      CHECK(volume == Approx(whole).epsilon(1e-6));
      out.pieces = std::max(out.pieces, static_cast<int>(wound.pieces.size()));
      if (wound.pieces.size() > 1)
        for (const topology::PieceShape& shape : topology::piece_shapes(wound))
          out.crumbs += shape.size < least ? 1 : 0;
    }
    CHECK(cut->area >= area - 1e-9);
    area = cut->area;
    out.front = cut->front_length;
  }
  out.area = area;
  return out;
}

} // namespace

TEST_CASE("Scribbles over a live block leave no crumbs and never stop cutting without a word", "[cut]") {
  const int first = scribble_setting("SPHERECUT_SCRIBBLES_FIRST", 1),
            count = scribble_setting("SPHERECUT_SCRIBBLES", 2), each = scribble_setting("SPHERECUT_SCRIBBLES_EACH", 1);
  for (int seed = first; seed < first + count; ++seed) {
    Scribbled out = scribble(static_cast<unsigned>(seed), each);
    std::sort(out.seconds.begin(), out.seconds.end());
    std::cout << "seed " << seed << ": " << out.solves << " solves, " << out.cuts << " increments, " << out.refused
              << " refused, " << out.failed << " failed, area " << 1e4 * out.area << " of " << 1e4 * out.swept
              << " cm2, front " << 1e2 * out.front << " cm, pieces at most " << out.pieces << ", crumbs " << out.crumbs;
    if (!out.seconds.empty())
      std::cout << ", median " << out.seconds[out.seconds.size() / 2] << " s, worst " << out.seconds.back()
                << " s, worst solve " << out.worst_solve << " s, lines " << out.most_lines;
    std::cout << "\n";
    for (const auto& [reason, times] : out.reasons)
      std::cout << "  " << times << " times: " << reason << "\n";
    std::cout << std::flush;
    CHECK(out.crumbs == 0);
    // What the hand has drawn is cut, or it has been told what is not.
    CHECK((out.area >= 0.5 * out.swept || out.refused + out.failed > 0));
  }
}

TEST_CASE("Scribbles that took longest look along no more lines than a live cut has time for", "[cut]") {
  // 0.67 and 0.91 million in the worst increments of these; 3.2 and 4.4 million where every line goes through the tree.
  const int before = solvers::thread_count();
  solvers::set_thread_count(1); // lines are counted thread by thread
  for (const unsigned seed : {1U, 3U}) {
    const Scribbled out = scribble(seed, 1);
    CAPTURE(seed, out.most_lines);
    CHECK(out.cuts >= 10);
    CHECK(out.most_lines > 10'000);
    CHECK(out.most_lines < 1'500'000);
  }
  solvers::set_thread_count(before);
}
