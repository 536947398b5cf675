#include "solvers/cut/growing_cut.hpp"
#include "tests/support/cut_block.hpp"
#include "topology/base/errors.hpp"
#include "topology/incision/cut_sheets.hpp"

#include <catch2/catch.hpp>
#include <random>

using namespace spherecut;
using namespace spherecut::solvers;

namespace {

constexpr int divisions = 6;
constexpr double spacing = 1.0 / divisions;

/// Block of edge 1 m, base held, with a cut that enters from -x along a tilted plane. Strips of the sheet are appended
/// one after another, and lip pairs come with them where interior nodes are far enough.
struct GrowingBlock {
  tests::CutFrame frame = tests::tilted_frame();
  std::shared_ptr<const topology::Domain> domain;
  NodeCloud nodes;
  std::vector<char> removed;
  topology::SurfaceMesh sheet;
  double front = -0.45;

  GrowingBlock() {
    const tests::CutBlock block = tests::cut_block(divisions, false, 3);
    domain = block.domain;
    for (int i = 0; i < block.nodes.size(); ++i)
      if (block.nodes.kinds[i] != NodeKind::lip)
        nodes.add(block.nodes, i);
    removed.assign(nodes.size(), 0);
    append_row(-0.9);
    append_row(front);
  }

  void append_row(double ahead) {
    constexpr int across = 8;
    const int first = static_cast<int>(sheet.vertices.size());
    for (int k = 0; k <= across; ++k)
      sheet.vertices.push_back(frame.origin + ahead * frame.ahead + (1.6 * k / across - 0.8) * frame.tangent);
    if (first == 0)
      return;
    // Counter-clockwise about the + side: ahead x (normal x ahead) is along the normal.
    for (int k = 0; k < across; ++k) {
      const int a = first - across - 1 + k, b = first + k;
      sheet.triangles.push_back({a, b, b + 1});
      sheet.triangles.push_back({a, b + 1, a + 1});
    }
  }

  [[nodiscard]] std::shared_ptr<const topology::Incision> incision() const {
    return std::make_shared<topology::Incision>(std::vector<topology::SurfaceMesh>{sheet}, domain);
  }

  [[nodiscard]] Problem problem() const {
    Problem p;
    p.domain = domain;
    p.incision = incision();
    p.nodes = nodes;
    p.material = {1000, 0.4, 0};
    for (int i = 0; i < nodes.size(); ++i)
      if (nodes.kinds[i] != NodeKind::interior && nodes.positions[i].z() < -0.5 + 1e-9)
        p.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
    p.prescribed_region = [](const Vector3& x, const Vector3& normal) { return normal.z() < -0.5 && x.z() < -0.49; };
    p.loads.body_force = [](const Vector3& x) { return Vector3(3 + x.y(), 1, -20); };
    return p;
  }

  [[nodiscard]] std::vector<int> contact() const {
    std::vector<int> candidates;
    for (int i = 0; i < nodes.size(); ++i)
      if (nodes.kinds[i] == NodeKind::surface && nodes.positions[i].z() > 0.5 - 1e-9 &&
          Vector3(nodes.positions[i].x() - 0.2, nodes.positions[i].y(), 0).norm() < 0.25)
        candidates.push_back(i);
    return candidates;
  }

  /// The cut grows by `step`; interior nodes within 0.3 spacings of the new strip go, lip pairs come on it.
  NodeChange grow(double step) {
    NodeChange change;
    const double from = front;
    front += step;
    append_row(front);
    for (int i = 0; i < nodes.size(); ++i) {
      const Vector3 d = nodes.positions[i] - frame.origin;
      if (removed[i] == 0 && nodes.kinds[i] == NodeKind::interior && std::abs(d.dot(frame.normal)) < 0.3 * spacing &&
          d.dot(frame.ahead) > from - 0.2 * spacing && d.dot(frame.ahead) < front + 0.2 * spacing) {
        change.removed.push_back(i);
        removed[i] = 1;
      }
    }
    for (double across = -0.4; across <= 0.4; across += 0.8 * spacing) {
      const Vector3 x = frame.origin + (front - 0.5 * spacing) * frame.ahead + across * frame.tangent;
      for (double side : {1.0, -1.0})
        change.added.add(x + side * lip_offset * spacing * frame.normal, spacing, NodeKind::lip, -side * frame.normal);
    }
    for (int k = 0; k < change.added.size(); ++k)
      nodes.add(change.added, k);
    removed.resize(nodes.size(), 0);
    return change;
  }

  /// The plane from `from` to `to`, as a predicted way.
  [[nodiscard]] topology::SurfaceMesh way(double from, double to) const {
    return tests::flat_sheet(frame, from, to, 0.6, 6);
  }
};

void check_against_scratch(const GrowingCut& cut, std::size_t candidates) {
  std::vector<Vector3> forces;
  for (std::size_t c = 0; c < candidates; ++c)
    forces.emplace_back(0.1 * static_cast<double>(c), -0.2, -1);
  const GrowingCut::Scratch scratch = cut.from_scratch(forces);
  CHECK((cut.compliance() - scratch.compliance).norm() < 1e-9 * scratch.compliance.norm());
  CHECK((cut.coefficients(forces) - scratch.coefficients).norm() < 1e-9 * scratch.coefficients.norm());
}

} // namespace

TEST_CASE("A cut that grows in its window gives the system built from scratch", "[growing_cut]") {
  const SightRule rule = GENERATE(SightRule::visibility, SightRule::diffraction, SightRule::enriched);
  GrowingBlock block;
  GrowthOptions options;
  options.method.sight = rule;
  options.way = block.way(-0.5, 0.2);
  options.contact = block.contact();
  options.room = 60;
  GrowingCut cut(block.problem(), options);
  check_against_scratch(cut, options.contact.size());
  const MatrixX before = cut.compliance();
  for (int increment = 0; increment < 3; ++increment) {
    GrowingBlock elsewhere = block;
    const NodeChange change = block.grow(0.12);
    if (increment == 1) { // what the next increment leaves alone, eliminated ahead
      const MatrixX forces = MatrixX::Constant(3 * std::ssize(cut.removed()), 1, 1e-3);
      const CaseResponses known = cut.condense_cases(forces, cut.candidates());
      cut.prepare(change, block.incision());
      const CaseResponses anew = cut.condense_cases(forces, cut.candidates());
      CHECK((known.among - anew.among).norm() < 1e-9 * known.among.norm());
      CHECK((known.at - anew.at).norm() < 1e-9 * known.at.norm());
    }
    if (increment == 2) // a shorter one than comes
      cut.prepare(elsewhere.grow(0.01), elsewhere.incision());
    const GrowthReport report = cut.grow(change, block.incision());
    INFO(report.reason);
    CHECK_FALSE(report.condensed_anew);
    CHECK(report.boxes > 0);
    CHECK(report.factored > 0);
    CHECK(report.factored <= cut.window_unknowns());
    if (increment == 0)
      CHECK_FALSE(report.prepared);
    if (increment == 1 && rule != SightRule::enriched) { // which reaches through so small a block
      CHECK(report.prepared);
      CHECK(report.factored < cut.window_unknowns());
    }
    check_against_scratch(cut, options.contact.size());
  }
  CHECK(cut.compliance().trace() > 1.01 * before.trace()); // a longer cut is softer
}

TEST_CASE("A cut that leaves its predicted way is condensed anew, and said", "[growing_cut]") {
  GrowingBlock block;
  GrowthOptions options;
  options.method.sight = SightRule::diffraction;
  options.method.support_radius = 1.5;
  options.way = block.way(-0.5, -0.44);
  options.contact = block.contact();
  GrowingCut cut(block.problem(), options);
  bool left = false;
  for (int increment = 0; increment < 4; ++increment) {
    const NodeChange change = block.grow(0.12);
    const GrowthReport report = cut.grow(change, block.incision());
    left = left || report.condensed_anew;
    check_against_scratch(cut, options.contact.size());
  }
  CHECK(left);
}

TEST_CASE("Nodes finer than the cells they come into are not followed on those cells", "[growing_cut]") {
  GrowingBlock block;
  GrowthOptions options;
  options.method.sight = SightRule::diffraction;
  options.way = block.way(-0.5, 0.4);
  options.contact = block.contact();
  options.method.estimate_condition = true;
  GrowingCut cut(block.problem(), options);
  const double condition = cut.report().condition_estimate;
  CHECK(condition > 1);
  NodeChange change = block.grow(0.12);
  NodeCloud fine;
  const Vector3 middle = block.frame.origin + 0.5 * spacing * block.frame.normal;
  for (int k = 0; k < 27; ++k)
    fine.add(middle + spacing / 3 * Vector3(k % 3 - 1.0, k / 3 % 3 - 1.0, k / 9 - 1.0), spacing / 3, NodeKind::interior,
             Vector3::Zero());
  for (int k = 0; k < fine.size(); ++k) {
    change.added.add(fine, k);
    block.nodes.add(fine, k);
  }
  block.removed.resize(static_cast<std::size_t>(block.nodes.size()), 0);
  const GrowthReport report = cut.grow(change, block.incision());
  CHECK(report.condensed_anew);
  CHECK_THAT(report.reason, Catch::Contains("finer than the cells"));
  CHECK(cut.report().condition_estimate > 1);
  CHECK(cut.report().condition_estimate != condition); // that of the body as it is now

  // The body assembled on the same nodes without any growth.
  Problem present = block.problem();
  present.nodes = {};
  std::vector<int> place(static_cast<std::size_t>(block.nodes.size()), -1);
  for (int i = 0; i < block.nodes.size(); ++i)
    if (block.removed[i] == 0) {
      place[i] = present.nodes.size();
      present.nodes.add(block.nodes, i);
    }
  for (Prescribed& entry : present.prescribed)
    entry.node = place[entry.node];
  const std::unique_ptr<Discretisation> anew = discretise(std::move(present), options.method);
  const VectorX followed = cut.coefficients(std::vector<Vector3>(options.contact.size(), Vector3::Zero()));
  const VectorX expected = anew->solve().coefficients;
  double worst = 0;
  for (int i = 0; i < block.nodes.size(); ++i)
    if (place[i] >= 0)
      worst = std::max(worst, (followed.segment<3>(3 * i) - expected.segment<3>(3 * place[i])).norm());
  CHECK(worst < 1e-6 * expected.lpNorm<Eigen::Infinity>());
}

TEST_CASE("A severed piece on springs is the same in the system built from scratch", "[growing_cut]") {
  GrowingBlock block;
  block.append_row(0.9); // across the whole block: nothing holds the upper part
  GrowthOptions options;
  options.way = block.way(-0.5, 0);
  options.contact = block.contact();
  options.method.unheld = UnheldPieces::hold;
  const GrowingCut cut(block.problem(), options);
  REQUIRE(cut.report().pieces.size() == 2);
  check_against_scratch(cut, options.contact.size());
}

TEST_CASE("A growing cut refuses what it cannot update", "[growing_cut]") {
  GrowingBlock block;
  GrowthOptions options;
  options.way = block.way(-0.5, 0);
  options.contact = block.contact();
  options.method.method = Method::collocation;
  CHECK_THROWS_AS(GrowingCut(block.problem(), options), InputError);
  options.method.method = Method::galerkin;
  options.way = {};
  CHECK_THROWS_AS(GrowingCut(block.problem(), options), InputError);
  options.way = block.way(-0.5, 0);
  GrowingCut cut(block.problem(), options);
  CHECK_THROWS_AS(cut.grow({{-1}, {}}, block.incision()), InputError);
  CHECK_THROWS_AS(cut.grow({}, nullptr), InputError);
}
