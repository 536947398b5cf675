#include "src/live/surface_follower.hpp"

#include "solvers/shapes/functions.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <span>
#include <unordered_map>

namespace spherecut::app {
namespace {

constexpr double front_share = 1.5; // of a support's radius: farther than that no new sheet changes shape functions

struct PlaceHash {
  std::size_t operator()(const Vector3& x) const {
    std::uint64_t hash = 0;
    for (int axis = 0; axis < 3; ++axis)
      hash = (hash ^ std::bit_cast<std::uint64_t>(x[axis])) * 0x9e3779b97f4a7c15U;
    return hash ^ (hash >> 29U);
  }
};
using PlaceMap = std::unordered_map<Vector3, int, PlaceHash>;

PlaceMap numbered(const std::vector<Vector3>& places) {
  PlaceMap map;
  map.reserve(places.size());
  for (std::size_t i = 0; i < places.size(); ++i)
    map.emplace(places[i], static_cast<int>(i));
  return map;
}

/// Places of a change, found by cells: whether one lies within a distance.
class ChangedPlaces {
 public:
  void add(const Vector3& place, double reach) { places_.push_back({place, reach}); }
  void all() { all_ = true; }
  /// Within its own reach, and `reach` more.
  [[nodiscard]] bool touch(const Vector3& x, double reach) const {
    return all_ || std::any_of(places_.begin(), places_.end(), [&](const Place& place) {
             const double within = place.reach + reach;
             return (place.at - x).squaredNorm() < within * within;
           });
  }

 private:
  struct Place {
    Vector3 at;
    double reach;
  };
  std::vector<Place> places_;
  bool all_ = false;
};

/// Where nodes have come, gone or changed their spheres; `now`: the number today of each node before, -1 where it is
/// gone.
ChangedPlaces changed_nodes(const std::vector<Vector3>& places_before, const std::vector<double>& radii_before,
                            const std::vector<Vector3>& nodes, const std::vector<double>& radii,
                            std::vector<int>& now) {
  ChangedPlaces changed;
  now.assign(places_before.size(), -1);
  const PlaceMap numbers = numbered(nodes);
  std::vector<char> met(nodes.size(), 0);
  for (std::size_t i = 0; i < places_before.size(); ++i) {
    const auto found = numbers.find(places_before[i]);
    if (found == numbers.end()) {
      changed.add(places_before[i], radii_before[i]);
      continue;
    }
    now[i] = found->second;
    met[static_cast<std::size_t>(found->second)] = 1;
    if (const double radius = radii[static_cast<std::size_t>(found->second)]; radius != radii_before[i])
      changed.add(places_before[i], std::max(radii_before[i], radius));
  }
  for (std::size_t i = 0; i < nodes.size(); ++i)
    if (met[i] == 0)
      changed.add(nodes[i], radii[i]);
  return changed;
}

/// Vertices that sheets have gained; sheets that do not go on as they were change everything.
void add_growth(const topology::Incision* before, const topology::Incision* now, ChangedPlaces& changed) {
  if (before == now)
    return;
  static const std::vector<topology::SurfaceMesh> none;
  const std::vector<topology::SurfaceMesh>& old_sheets = before != nullptr ? before->sheets() : none;
  const std::vector<topology::SurfaceMesh>& sheets = now != nullptr ? now->sheets() : none;
  if (sheets.size() < old_sheets.size()) {
    changed.all();
    return;
  }
  for (std::size_t s = 0; s < sheets.size(); ++s) {
    const std::size_t known = s < old_sheets.size() ? old_sheets[s].triangles.size() : 0;
    if (sheets[s].triangles.size() < known) {
      changed.all();
      return;
    }
    for (std::size_t t = known; t < sheets[s].triangles.size(); ++t) {
      const Triangle& triangle = sheets[s].triangles[t];
      std::array<Vector3, 3> corners;
      for (std::size_t c = 0; c < 3; ++c)
        corners[c] = sheets[s].vertices[static_cast<std::size_t>(triangle[c])];
      const Vector3 middle = (corners[0] + corners[1] + corners[2]) / 3;
      double reach = 0;
      for (const Vector3& corner : corners)
        reach = std::max(reach, (corner - middle).norm());
      changed.add(middle, reach);
    }
  }
}

using Tag = ViewerTopology::Tag;

std::vector<Tag> tags_of(const topology::Wound& wound) {
  std::vector<char> organ(wound.surface.vertices.size(), 0);
  std::vector<char> wall(wound.surface.vertices.size(), 0);
  for (std::size_t t = 0; t < wound.surface.triangles.size(); ++t)
    for (const int vertex : wound.surface.triangles[t])
      (wound.part[t] == topology::WoundPart::organ ? organ : wall)[static_cast<std::size_t>(vertex)] = 1;
  std::unordered_map<int, int> copies; // of one point of the cut, among the walls' vertices
  for (std::size_t v = 0; v < wall.size(); ++v)
    if (wall[v] != 0)
      ++copies[wound.point[v]];
  std::vector<Tag> tags(organ.size(), Tag::surface);
  for (std::size_t v = 0; v < tags.size(); ++v)
    if (wall[v] != 0) {
      const bool single = copies[wound.point[v]] == 1;
      tags[v] = single ? Tag::front : organ[v] != 0 ? Tag::lip : Tag::wall;
    }
  return tags;
}

} // namespace

void SurfaceFollower::follow(const Session& session) {
  take_surface(session);
  take_rows(session);
}

void SurfaceFollower::take_surface(const Session& session) {
  const topology::Wound* wound = session.wound();
  const topology::SurfaceMesh& surface = wound != nullptr ? wound->surface : session.organ().domain->surface();
  // The places tell surfaces apart as well: a cut that grows adds vertices, one that is taken back removes them.
  if (topology_ != nullptr && surface.vertices == places_ && surface.triangles == topology_->triangles)
    return;
  auto next = std::make_shared<ViewerTopology>();
  next->number = topology_ != nullptr ? topology_->number + 1 : 1;
  places_ = surface.vertices;
  evaluation_ = wound != nullptr ? wound->evaluation : surface.vertices;
  next->vertices.reserve(places_.size());
  for (const Vector3& x : places_)
    next->vertices.emplace_back(x.cast<float>());
  next->triangles = surface.triangles;
  if (wound != nullptr) {
    next->tags = tags_of(*wound);
    next->parts = wound->part;
    for (std::size_t t = 0; t < surface.triangles.size(); ++t)
      next->pieces.push_back(static_cast<std::uint16_t>(std::max(0, wound->piece_of(static_cast<int>(t)))));
    for (const topology::LipPair& pair : topology::lip_pairs(*wound))
      next->lip_pairs.push_back({pair.plus, pair.minus});
    for (const topology::WoundPiece& piece : wound->pieces)
      next->volumes.push_back(piece.volume);
  } else {
    next->tags.assign(places_.size(), Tag::surface);
    next->parts.assign(surface.triangles.size(), topology::WoundPart::organ);
    next->pieces.assign(surface.triangles.size(), 0);
    next->volumes.push_back(topology::volume(surface));
  }
  topology_ = std::move(next);
}

/// The row of a place whose shape functions are evaluated anew, at the end of `into`.
void SurfaceFollower::add_row(const solvers::ShapeFunctions& shape, const std::vector<double>& radii, Row& row,
                              Rows& into) {
  const auto spheres = static_cast<int>(radii.size());
  for (const solvers::VectorTerm& term : shape.vectors)
    into.terms.push_back({term.group, term.value});
  for (std::size_t k = 0; k < shape.nodes.size(); ++k) {
    const int node = shape.nodes[k];
    if (node >= spheres) {
      into.terms.push_back({node, shape.value[k] * Matrix3::Identity()});
      continue;
    }
    ++row.count;
    into.nodes.push_back(node);
    into.weights.push_back(shape.value[k]);
    row.radius = std::max(row.radius, front_share * radii[static_cast<std::size_t>(node)]);
  }
}

// A row stays when the nodes in it are the same, none with x in its sphere has come or gone, and no new part of the
// cut is near.
void SurfaceFollower::take_rows(const Session& session) {
  evaluated_ = 0;
  const BodyModel& model = session.model();
  if (!model.built()) {
    rows_ = {};
    row_places_.clear();
    return;
  }
  const int spheres = model.sphere_count();
  const std::vector<Vector3>& all = model.nodes().positions;
  const std::vector<Vector3> nodes(all.begin(), all.begin() + spheres);
  std::vector<double> radii(nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i)
    radii[i] = model.sphere_radius(static_cast<int>(i));
  if (!rows_.rows.empty() && nodes == node_places_ && radii == node_radii_ && kept_incision_ == model.incision &&
      evaluation_ == row_places_)
    return;

  const bool appends = 3 * spheres != model.coefficient_count() || !rows_.terms.empty();
  ChangedPlaces changed;
  std::vector<int> now(node_places_.size(), -1);
  if (rows_.rows.empty() || appends) // functions of a cut have other numbers after each increment
    changed.all();
  else
    changed = changed_nodes(node_places_, node_radii_, nodes, radii, now);
  ChangedPlaces cut;
  add_growth(kept_incision_.get(), model.incision.get(), cut);

  const PlaceMap old_rows = rows_.rows.empty() ? PlaceMap{} : numbered(row_places_);
  Rows next;
  next.rows.resize(evaluation_.size());
  next.nodes.reserve(rows_.nodes.size());
  next.weights.reserve(rows_.weights.size());
  solvers::ShapeFunctions shape;
  for (std::size_t v = 0; v < evaluation_.size(); ++v) {
    const Vector3& x = evaluation_[v];
    Row& row = next.rows[v];
    row.first = static_cast<int>(next.nodes.size());
    row.first_term = static_cast<int>(next.terms.size());
    const auto old = old_rows.find(x);
    if (old != old_rows.end() && !changed.touch(x, 0)) {
      const Row& before = rows_.rows[static_cast<std::size_t>(old->second)];
      const std::span<const int> of_before(rows_.nodes.data() + before.first, static_cast<std::size_t>(before.count));
      // Where a support had to be grown, or another point stands in, a node may be gone that did not reach here.
      const bool whole = std::all_of(of_before.begin(), of_before.end(),
                                     [&](int node) { return now[static_cast<std::size_t>(node)] >= 0; });
      if (whole && !cut.touch(x, before.radius)) {
        row.count = before.count;
        row.radius = before.radius;
        for (const int node : of_before)
          next.nodes.push_back(now[static_cast<std::size_t>(node)]);
        next.weights.insert(next.weights.end(), rows_.weights.begin() + before.first,
                            rows_.weights.begin() + before.first + before.count);
        continue;
      }
    }
    model.shape_at(x, shape);
    ++evaluated_;
    add_row(shape, radii, row, next);
  }
  for (std::size_t v = 0; v < next.rows.size(); ++v)
    next.rows[v].terms =
        (v + 1 < next.rows.size() ? next.rows[v + 1].first_term : static_cast<int>(next.terms.size())) -
        next.rows[v].first_term;
  rows_ = std::move(next);
  node_places_ = nodes;
  node_radii_ = std::move(radii);
  row_places_ = evaluation_;
  kept_incision_ = model.incision;
}

void SurfaceFollower::deform(const Session& session, std::vector<Eigen::Vector3f>& vertices) const {
  vertices = topology_->vertices;
  const BodyModel& model = session.model();
  if (rows_.rows.empty() || !model.solved())
    return;
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    Vector3 displacement = Vector3::Zero();
    const Row& row = rows_.rows[v];
    for (int k = row.first; k < row.first + row.count; ++k)
      displacement += rows_.weights[static_cast<std::size_t>(k)] *
                      model.field.coefficients.segment<3>(3 * rows_.nodes[static_cast<std::size_t>(k)]);
    for (int k = row.first_term; k < row.first_term + row.terms; ++k)
      displacement += rows_.terms[static_cast<std::size_t>(k)].value *
                      model.field.coefficients.segment<3>(
                          3 * static_cast<Eigen::Index>(rows_.terms[static_cast<std::size_t>(k)].group));
    vertices[v] = (places_[v] + displacement).cast<float>();
  }
}

void SurfaceFollower::spread(const std::vector<double>& nodal, std::vector<float>& values) const {
  values.assign(places_.size(), 0);
  for (std::size_t v = 0; v < rows_.rows.size(); ++v) {
    double value = 0, whole = 0;
    for (int k = rows_.rows[v].first; k < rows_.rows[v].first + rows_.rows[v].count; ++k) {
      const double weight = rows_.weights[static_cast<std::size_t>(k)];
      value += weight * nodal[static_cast<std::size_t>(rows_.nodes[static_cast<std::size_t>(k)])];
      whole += weight;
    }
    // Where functions of nodes beyond a cut have the rest, those of this side tell.
    constexpr double least = 0.05, rounding = 1e-6;
    values[v] = static_cast<float>(whole > least && std::abs(whole - 1) > rounding ? value / whole : value);
  }
}

} // namespace spherecut::app
