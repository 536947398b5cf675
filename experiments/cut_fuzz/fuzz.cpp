#include "experiments/cut_fuzz/fuzz.hpp"

#include "topology/errors.hpp"
#include "topology/organs.hpp"
#include "topology/piece_audit.hpp"
#include "topology/surface_check.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fmt/format.h>
#include <iterator>
#include <numeric>
#include <set>

namespace spherecut::experiments {

using topology::SurfaceMesh;
using topology::Wound;
using topology::WoundPart;

namespace {

constexpr double volume_tolerance = 1e-9; // of the organ's

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

  // Material is held by an outer component: one that encloses something.
  std::vector<bool> encloses(wound.pieces.size(), false);
  for (const topology::WoundComponent& component : wound.components)
    if (component.volume != 0)
      encloses[component.piece] = true;
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
    std::mt19937_64 random(static_cast<std::uint64_t>(blade) * 0x9E3779B97F4A7C15ULL + 1);
    random.discard(8);
    const FuzzCut cut = make_fuzz_cut(organ, blade % fuzz_kind_count(), random);
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

std::vector<FuzzOrgan> fuzz_organs() {
  std::vector<FuzzOrgan> organs;
  const auto add_organ = [&](const std::string& name, const SurfaceMesh& surface) {
    organs.push_back({name, surface, topology::make_organ_domain(surface)});
  };
  add_organ("block", topology::make_block({0.1, 0.06, 0.04}, 0.01));
  add_organ("liver", topology::make_liver(2000));
  if (const char* file = std::getenv("SPHERECUT_LIVER_OBJ"); file != nullptr)
    add_organ("scanned liver", topology::read_surface(file, 0.0337).mesh);
  else
    add_organ("cylinder", topology::make_cylinder(0.04, 0.05, 0.01));
  return organs;
}

} // namespace spherecut::experiments
