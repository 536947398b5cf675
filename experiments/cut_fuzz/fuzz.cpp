#include "experiments/cut_fuzz/fuzz.hpp"

#include "topology/base/errors.hpp"
#include "topology/organ/organs.hpp"
#include "topology/organ/surface_check.hpp"
#include "topology/wound/piece_audit.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fmt/format.h>
#include <functional>
#include <iterator>
#include <numeric>
#include <set>
#include <tuple>

namespace spherecut::experiments {

using topology::SurfaceMesh;
using topology::Wound;
using topology::WoundPart;

namespace {

constexpr double volume_tolerance = 1e-9; // of the organ's

// Boxes of a common grid, as one surface without the walls between them. `lines`: m, where the grid's planes lie along
// each axis; `is_solid` tells of a cell by its three numbers. No two solid cells may meet in an edge or a corner alone.
SurfaceMesh solid_of_cells(const std::array<std::vector<double>, 3>& lines,
                           const std::function<bool(int, int, int)>& is_solid) {
  const std::array<int, 3> cells{static_cast<int>(lines[0].size()) - 1, static_cast<int>(lines[1].size()) - 1,
                                 static_cast<int>(lines[2].size()) - 1};
  SurfaceMesh mesh;
  std::map<std::array<int, 3>, int> numbers;
  const auto vertex = [&](const std::array<int, 3>& at) {
    const auto [found, is_new] = numbers.try_emplace(at, static_cast<int>(mesh.vertices.size()));
    if (is_new)
      mesh.vertices.emplace_back(lines[0][at[0]], lines[1][at[1]], lines[2][at[2]]);
    return found->second;
  };
  const auto solid = [&](const std::array<int, 3>& at) {
    for (int axis = 0; axis < 3; ++axis)
      if (at[axis] < 0 || at[axis] >= cells[axis])
        return false;
    return is_solid(at[0], at[1], at[2]);
  };
  std::array<int, 3> at{};
  for (at[0] = 0; at[0] < cells[0]; ++at[0])
    for (at[1] = 0; at[1] < cells[1]; ++at[1])
      for (at[2] = 0; at[2] < cells[2]; ++at[2]) {
        if (!solid(at))
          continue;
        for (int axis = 0; axis < 3; ++axis)
          for (const int side : {0, 1}) {
            std::array<int, 3> beside = at;
            beside[axis] += side == 1 ? 1 : -1;
            if (solid(beside))
              continue;
            const int u = (axis + 1) % 3, v = (axis + 2) % 3;
            std::array<std::array<int, 3>, 4> corners{at, at, at, at};
            for (auto& corner : corners)
              corner[axis] += side;
            ++corners[1][u];
            ++corners[2][u];
            ++corners[2][v];
            ++corners[3][v];
            if (side == 0)
              std::swap(corners[1], corners[3]); // outward
            const int a = vertex(corners[0]), b = vertex(corners[1]), c = vertex(corners[2]), d = vertex(corners[3]);
            mesh.triangles.push_back({a, b, c});
            mesh.triangles.push_back({a, c, d});
          }
      }
  return mesh;
}

// Planes a step apart from `from` to `to`, and those `more`, m.
std::vector<double> planes(double from, double to, int steps, std::initializer_list<double> more = {}) {
  std::vector<double> at(more);
  for (int k = 0; k <= steps; ++k)
    at.push_back(std::lerp(from, to, static_cast<double>(k) / steps));
  std::sort(at.begin(), at.end());
  return at;
}

// A block of 100 x 60 x 40 mm with two fissures down from its top, 0.1 and 1 mm wide, which cross.
SurfaceMesh fissured_block() {
  const std::array lines{planes(-0.05, 0.05, 10, {0.0049, 0.0050, 0.0051}), planes(-0.03, 0.03, 6, {0.0035, 0.0045}),
                         planes(0, 0.04, 4, {0.012})};
  std::array<std::vector<double>, 3> distinct = lines;
  for (std::vector<double>& axis : distinct)
    axis.erase(std::unique(axis.begin(), axis.end()), axis.end());
  return solid_of_cells(distinct, [distinct](int i, int j, int k) {
    const double x = 0.5 * (distinct[0][i] + distinct[0][i + 1]), y = 0.5 * (distinct[1][j] + distinct[1][j + 1]),
                 z = 0.5 * (distinct[2][k] + distinct[2][k + 1]);
    const bool narrow = x > 0.0049 && x < 0.0050 && z > 0.012, wide = y > 0.0035 && y < 0.0045 && z > 0.02;
    return !narrow && !wide;
  });
}

// A box without lid, 100 x 60 x 40 mm, with walls of `wall` m.
SurfaceMesh open_box(double wall) {
  const std::array lines{planes(-0.05, 0.05, 10, {-0.05 + wall, 0.05 - wall}),
                         planes(-0.03, 0.03, 6, {-0.03 + wall, 0.03 - wall}), planes(0, 0.04, 4, {wall})};
  return solid_of_cells(lines, [lines](int i, int j, int k) {
    return k == 0 || i == 0 || j == 0 || i + 2 == std::ssize(lines[0]) || j + 2 == std::ssize(lines[1]);
  });
}

// A block of 100 x 60 x 40 mm with a closed cavity of 40 x 20 x 20 mm.
SurfaceMesh block_with_cavity() {
  const std::array lines{planes(-0.05, 0.05, 10), planes(-0.03, 0.03, 6), planes(0, 0.04, 4)};
  return solid_of_cells(lines, [](int i, int j, int k) { return i < 3 || i > 6 || j < 2 || j > 3 || k < 1 || k > 2; });
}

// A block of 60 x 60 x 40 mm, 5 mm beside it one of 30 x 60 x 40 mm, and as the third a crumb of 2 mm.
SurfaceMesh islands(int count) {
  SurfaceMesh all;
  for (const auto& [lower, upper, edge] :
       {std::tuple(Vector3(-0.05, -0.03, 0), Vector3(0.01, 0.03, 0.04), 0.01),
        std::tuple(Vector3(0.015, -0.03, 0), Vector3(0.045, 0.03, 0.04), 0.01),
        std::tuple(Vector3(0.0485, -0.001, 0.019), Vector3(0.0505, 0.001, 0.021), 0.002)}) {
    if (count-- == 0)
      break;
    const SurfaceMesh block = topology::make_block(lower, upper, edge);
    const int first = static_cast<int>(all.vertices.size());
    all.vertices.insert(all.vertices.end(), block.vertices.begin(), block.vertices.end());
    for (const Triangle& triangle : block.triangles)
      all.triangles.push_back({triangle[0] + first, triangle[1] + first, triangle[2] + first});
  }
  return all;
}

} // namespace

std::optional<std::string> wound_defect(const Wound& wound, double organ_volume) {
  const SurfaceMesh& surface = wound.surface;
  if (auto defect = topology::manifold_defect(surface))
    return defect;
  for (const std::vector<Vector3>* points : {&surface.vertices, &wound.evaluation})
    for (const Vector3& x : *points)
      if (!x.allFinite())
        return "a coordinate is not finite";
  const double total = topology::volume(surface);
  if (!(std::abs(total / organ_volume - 1) <= volume_tolerance))
    return fmt::format("volume changes by {:.3g} of itself", total / organ_volume - 1);

  if (auto difference = topology::component_difference(wound))
    return difference;
  std::vector<double> piece_volumes(wound.pieces.size(), 0);
  for (const topology::WoundComponent& component : wound.components)
    piece_volumes[component.piece] += component.volume;
  for (std::size_t p = 0; p < wound.pieces.size(); ++p)
    if (!(std::abs(wound.pieces[p].volume - piece_volumes[p]) <= volume_tolerance * organ_volume) ||
        wound.pieces[p].components < 1 || !(wound.pieces[p].volume > -volume_tolerance * organ_volume))
      return fmt::format("piece of {:.6g} m3 in {} components, recounted {:.6g} m3", wound.pieces[p].volume,
                         wound.pieces[p].components, piece_volumes[p]);

  // Material is held by an outer component: one that encloses something, or a splinter between two sheets, so thin that
  // its volume is none, which has a face of the organ.
  std::vector<bool> encloses(wound.pieces.size(), false);
  for (const topology::WoundComponent& component : wound.components)
    if (component.volume != 0)
      encloses[component.piece] = true;
  for (std::size_t t = 0; t < wound.part.size(); ++t)
    if (wound.part[t] == WoundPart::organ)
      encloses[wound.piece_of(static_cast<int>(t))] = true;
  if (std::find(encloses.begin(), encloses.end(), false) != encloses.end())
    return "a cavity is counted as a piece of material";

  std::map<Triangle, int> twins; // a wall counts 1, its twin -1
  for (std::size_t t = 0; t < wound.part.size(); ++t) {
    if (wound.part[t] == WoundPart::organ)
      continue;
    Triangle points{};
    for (int c = 0; c < 3; ++c)
      points[c] = wound.point[surface.triangles[t][c]];
    std::sort(points.begin(), points.end());
    twins[points] += wound.part[t] == WoundPart::wall_plus ? 1 : -1;
  }
  for (const auto& [points, balance] : twins)
    if (balance != 0)
      return "a wall faces no other";
  return std::nullopt;
}

FuzzOutcome cut_fuzz(const FuzzOrgan& organ, int first, int count) {
  const double organ_volume = topology::volume(organ.surface);
  FuzzOutcome outcome;
  for (int blade = first; blade < first + count; ++blade) {
    const FuzzCut cut = make_fuzz_cut(organ, blade);
    ++outcome.blades;
    ++outcome.kinds[cut.kind];
    const auto fail = [&](const std::string& what) {
      outcome.failures.push_back(fmt::format("{}, blade {} ({}): {}", organ.name, blade, cut.kind, what));
    };
    try {
      topology::IncrementalWound growing(organ.surface);
      bool refused = false;
      for (const std::vector<SurfaceMesh>& sheets : cut.stages) {
        ++outcome.stages;
        const std::uint64_t before = topology::surface_hash(growing.wound().surface);
        try {
          growing.grow(sheets);
        } catch (const InputError& error) {
          refused = true;
          if (topology::surface_hash(growing.wound().surface) != before)
            fail("refused, and the surface before is lost");
          fail(std::string("refused: ") + error.what());
        }
        if (refused)
          break;
        if (const auto defect = wound_defect(growing.wound(), organ_volume)) {
          fail("grown: " + *defect);
          break;
        }
      }
      outcome.refused += refused;
      if (refused || cut.stages.empty())
        continue;
      const Wound& grown = growing.wound();
      const Wound at_once = topology::cut_surface(organ.surface, cut.stages.back());
      if (const auto defect = wound_defect(at_once, organ_volume))
        fail("at once: " + *defect);
      if (topology::surface_hash(grown.surface) != topology::surface_hash(at_once.surface) ||
          grown.components.size() != at_once.components.size() || grown.pieces.size() != at_once.pieces.size()) {
        fail(fmt::format("grown has {} triangles, {} components, {} pieces; at once {}, {}, {}",
                         grown.surface.triangles.size(), grown.components.size(), grown.pieces.size(),
                         at_once.surface.triangles.size(), at_once.components.size(), at_once.pieces.size()));
        continue;
      }
      const auto volumes = [](const Wound& wound) {
        std::vector<double> sorted;
        for (const topology::WoundPiece& piece : wound.pieces)
          sorted.push_back(piece.volume);
        std::sort(sorted.begin(), sorted.end());
        return sorted;
      };
      const std::vector<double> a = volumes(grown), b = volumes(at_once);
      for (std::size_t p = 0; p < a.size(); ++p)
        outcome.worst_piece = std::max(outcome.worst_piece, std::abs(a[p] - b[p]) / organ_volume);
      outcome.worst_volume =
          std::max(outcome.worst_volume, std::abs(topology::volume(grown.surface) / organ_volume - 1));
      outcome.opened +=
          std::any_of(grown.part.begin(), grown.part.end(), [](WoundPart part) { return part != WoundPart::organ; });
      outcome.severed += grown.pieces.size() > 1;
      outcome.most_pieces = std::max(outcome.most_pieces, static_cast<int>(grown.pieces.size()));
    } catch (const std::exception& error) {
      fail(std::string("threw: ") + error.what());
    }
  }
  return outcome;
}

void add(FuzzOutcome& total, const FuzzOutcome& more) {
  total.blades += more.blades;
  total.stages += more.stages;
  total.opened += more.opened;
  total.severed += more.severed;
  total.refused += more.refused;
  total.most_pieces = std::max(total.most_pieces, more.most_pieces);
  total.worst_volume = std::max(total.worst_volume, more.worst_volume);
  total.worst_piece = std::max(total.worst_piece, more.worst_piece);
  for (const auto& [kind, count] : more.kinds)
    total.kinds[kind] += count;
  total.failures.insert(total.failures.end(), more.failures.begin(), more.failures.end());
}

namespace {

void add_organ(std::vector<FuzzOrgan>& organs, const std::string& name, const SurfaceMesh& surface) {
  organs.push_back({name, surface, topology::make_organ_domain(surface)});
}

} // namespace

std::vector<FuzzOrgan> fuzz_organs() {
  std::vector<FuzzOrgan> organs;
  add_organ(organs, "block", topology::make_block({0.1, 0.06, 0.04}, 0.01));
  add_organ(organs, "liver", topology::make_liver(2000));
  if (const char* file = std::getenv("SPHERECUT_LIVER_OBJ"); file != nullptr)
    add_organ(organs, "scanned liver", topology::read_surface(file, 0.0337).mesh);
  else
    add_organ(organs, "cylinder", topology::make_cylinder(0.04, 0.05, 0.01));
  add_organ(organs, "fissured block", fissured_block());
  add_organ(organs, "thin walls", open_box(0.0005));
  add_organ(organs, "cavity", block_with_cavity());
  add_organ(organs, "islands", islands(3));
  return organs;
}

std::vector<FuzzOrgan> solved_organs() {
  std::vector<FuzzOrgan> organs;
  add_organ(organs, "fissured block", fissured_block());
  add_organ(organs, "walls of 5 mm", open_box(0.005));
  add_organ(organs, "cavity", block_with_cavity());
  add_organ(organs, "islands", islands(2));
  return organs;
}

} // namespace spherecut::experiments
