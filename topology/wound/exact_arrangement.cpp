#include "topology/wound/exact_arrangement.hpp"

#include "topology/base/errors.hpp"
#include "topology/search/overlap_tree.hpp"
#include "topology/surface/triangle_corners.hpp"
#include "topology/wound/exact_points.hpp"
#include "topology/wound/triangle_meeting.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fmt/format.h>
#include <optional>
#include <utility>

namespace spherecut::topology {

namespace {

/// Where a facet lies. A sheet facet that coincides with one of the surface is `covering`; `reached` is passing: in the
/// patch being placed.
enum class Place : std::uint8_t { unknown, reached, surface, inside, outside, covering };

struct Piece { // a facet and what is known of it
  ExactArrangement::Facet facet;
  Place place = Place::unknown;
  bool alive = true, active = false;
};

/// What the other triangles leave on one.
struct Marks {
  std::vector<std::pair<int, int>> segments; // ascending ends
  std::vector<int> points;
};

Triangle sorted(Triangle t) {
  std::sort(t.begin(), t.end());
  return t;
}

constexpr int ray_tries = 30;

} // namespace

struct ExactArrangement::Data {
  ExactPoints points;
  std::vector<Triangle> sources; // point numbers
  int surface_count = 0;
  double size = 0; // m, diagonal of the surface's bounding box
  std::vector<Marks> marks;
  std::vector<std::vector<int>> facets_of; // alive facets by source
  std::vector<Piece> pieces;
  std::vector<std::vector<int>> star; // alive facets by point

  OverlapTree surface_tree;
  struct SheetTree {
    int first; // source
    OverlapTree tree;
  };
  std::vector<SheetTree> sheet_trees; // of falling size

  // --- facets ---

  int add_facet(const Facet& facet) {
    const int number = static_cast<int>(pieces.size());
    const bool surface = facet.source < surface_count;
    pieces.push_back({facet, surface ? Place::surface : Place::unknown});
    if (std::ssize(star) < points.count())
      star.resize(points.count());
    for (const int p : facet.points)
      star[p].push_back(number);
    facets_of[facet.source].push_back(number);
    return number;
  }

  void remove_facet(int f) {
    pieces[f].alive = false;
    for (const int p : pieces[f].facet.points)
      std::erase(star[p], f);
  }

  /// Alive facets with the edge; `surface` chooses those of the surface or of the sheets.
  void at_edge(int u, int v, bool surface, std::vector<int>& found) const {
    const std::vector<int>& shorter = star[u].size() <= star[v].size() ? star[u] : star[v];
    const int other = &shorter == &star[u] ? v : u;
    for (const int f : shorter)
      if (has_corner(pieces[f].facet.points, other) && (pieces[f].facet.source < surface_count) == surface)
        found.push_back(f);
  }

  /// All alive facets with the same three corners, by source.
  [[nodiscard]] std::vector<int> coinciding(const Triangle& t) const {
    std::vector<int> found;
    const Triangle key = sorted(t);
    for (const int f : star[t[0]])
      if (sorted(pieces[f].facet.points) == key)
        found.push_back(f);
    std::sort(found.begin(), found.end(),
              [&](int a, int b) { return pieces[a].facet.source < pieces[b].facet.source; });
    return found;
  }

  // --- intersection of two triangles ---

  /// Adds to the marks of a source what another leaves on it, unless that is corners and edges alone; true when added.
  bool mark(int source, const std::vector<std::vector<int>>& found) {
    const Triangle& t = sources[source];
    bool any = false;
    for (const std::vector<int>& ends : found) {
      if (std::all_of(ends.begin(), ends.end(), [&](int p) { return has_corner(t, p); }))
        continue;
      any = true;
      if (ends.size() == 2)
        marks[source].segments.emplace_back(ends[0], ends[1]);
      else
        marks[source].points.push_back(ends[0]);
    }
    return any;
  }

  void intersect(int i, int j, std::vector<int>& dirty) {
    if (surely_apart(points, sources[i], sources[j]))
      return;
    const TriangleMeeting meeting = meet(points, sources[i], sources[j]);
    if (mark(i, meeting.on_first))
      dirty.push_back(i);
    if (mark(j, meeting.on_second))
      dirty.push_back(j);
  }

  // --- refinement ---

  /// Facets of one source after its marks changed: replaces those that differ.
  void refine(int source, std::vector<int>& removed, std::vector<int>& added) {
    Marks& mine = marks[source];
    std::sort(mine.segments.begin(), mine.segments.end());
    mine.segments.erase(std::unique(mine.segments.begin(), mine.segments.end()), mine.segments.end());
    keep_once(mine.points);
    std::vector<Triangle> wanted = mine.segments.empty() && mine.points.empty()
                                       ? std::vector<Triangle>{sources[source]}
                                       : points.triangulate(sources[source], mine.segments, mine.points);
    const auto by_corners = [](const Triangle& x, const Triangle& y) { return sorted(x) < sorted(y); };
    std::sort(wanted.begin(), wanted.end(), by_corners);
    std::vector<bool> present(wanted.size(), false);
    std::vector<int> kept;
    for (const int f : facets_of[source]) {
      const Triangle& corners = pieces[f].facet.points;
      const auto same = std::lower_bound(wanted.begin(), wanted.end(), corners, by_corners);
      if (same != wanted.end() && sorted(*same) == sorted(corners)) {
        present[same - wanted.begin()] = true;
        kept.push_back(f);
      } else {
        remove_facet(f);
        removed.push_back(f);
      }
    }
    facets_of[source] = std::move(kept);
    for (std::size_t k = 0; k < wanted.size(); ++k)
      if (!present[k])
        added.push_back(add_facet({wanted[k], source}));
  }

  // --- inside or outside ---

  /// Angle class of w about u -> v counted from r: 0 along r, 1 within the half turn after it, 2 opposite, 3 beyond.
  [[nodiscard]] int sector(int u, int v, int r, int w) const {
    const int side = w == r ? 0 : points.orientation(u, v, r, w);
    if (side != 0)
      return side > 0 ? 1 : 3;
    return w == r || points.same_side(u, v, r, w) > 0 ? 0 : 2;
  }

  /// Whether w1 comes strictly before w2 turning counter-clockwise about u -> v from r.
  [[nodiscard]] bool before(int u, int v, int r, int w1, int w2) const {
    const int s1 = sector(u, v, r, w1), s2 = sector(u, v, r, w2);
    return s1 != s2 ? s1 < s2 : (s1 == 1 || s1 == 3) && w1 != w2 && points.orientation(u, v, w1, w2) > 0;
  }

  /// Place of a facet with an edge on the surface: between the facets of the surface there, through the solid or not.
  [[nodiscard]] Place place_at_edge(int f, int u, int v, const std::vector<int>& surface) const {
    int from = -1, to = -1; // the solid lies counter-clockwise from `from` to `to` about u -> v
    for (const int s : surface)
      (runs(pieces[s].facet.points, u, v) ? to : from) = third_corner(pieces[s].facet.points, u, v);
    if (from < 0 || to < 0)
      throw NumericalError(fmt::format("the surface is not closed at the edge of points {} and {}", u, v));
    return before(u, v, from, third_corner(pieces[f].facet.points, u, v), to) ? Place::inside : Place::outside;
  }

  /// 1 when the segment passes the triangle along its normal, -1 against it, 0 when it misses it; nothing when it
  /// touches its border or lies in its plane.
  [[nodiscard]] std::optional<int> crossing(int from, int to, const Triangle& t) const {
    const int start = points.orientation(t[0], t[1], t[2], from), end = points.orientation(t[0], t[1], t[2], to);
    if (start * end > 0)
      return 0;
    int left = 0, right = 0;
    for (int e = 0; e < 3; ++e) {
      const int turn = points.orientation(from, to, t[e], t[(e + 1) % 3]);
      left += turn > 0;
      right += turn < 0;
    }
    if (left > 0 && right > 0)
      return 0;
    if (start == 0 || end == 0 || (left < 3 && right < 3))
      return std::nullopt;
    return end;
  }

  /// The far end of ray number `k` from a point, beyond the surface.
  int far_end(const Vector3& start, int k) {
    const double reach = 2 * (size + (points.position(sources[0][0]) - start).norm());
    const double height = (2 * k + 1.0) / ray_tries - 1, turn = 2.399963 * (k + 1); // a spiral over the sphere
    const double radius = std::sqrt(1 - height * height);
    return points.add(start + reach * Vector3(radius * std::cos(turn), radius * std::sin(turn), height));
  }

  /// Place of a facet by the parity of a ray from its centroid.
  Place place_by_ray(int f) {
    const int from = points.centroid(pieces[f].facet.points);
    const Vector3 start = points.position(from);
    for (int k = 0; k < ray_tries; ++k) {
      const int to = far_end(start, k);
      std::vector<int> near;
      surface_tree.along(start, points.position(to), near);
      int crossings = 0;
      bool clear = true;
      for (const int s : near) {
        const std::optional<int> crossed = crossing(from, to, sources[s]);
        clear = clear && crossed;
        crossings += crossed.value_or(0) != 0;
      }
      if (clear)
        return crossings % 2 == 1 ? Place::inside : Place::outside;
    }
    throw NumericalError(fmt::format("cannot tell whether the sheet is inside at ({:.6g}, {:.6g}, {:.6g}) m", start.x(),
                                     start.y(), start.z()));
  }

  /// Places the new sheet facets: each patch bounded by the surface lies on one side of it.
  void place(const std::vector<int>& added) {
    for (const int f : added)
      if (pieces[f].place == Place::unknown) {
        const int first = coinciding(pieces[f].facet.points).front();
        if (pieces[first].facet.source < surface_count)
          pieces[f].place = Place::covering;
      }
    std::vector<int> surface, sheets;
    for (const int start : added) {
      if (pieces[start].place != Place::unknown)
        continue;
      std::vector<int> patch = {start};
      pieces[start].place = Place::reached;
      Place known = Place::unknown;
      std::array<int, 3> rim{-1, -1, -1}; // facet and edge on the surface
      for (std::size_t k = 0; k < patch.size(); ++k) {
        const Triangle t = pieces[patch[k]].facet.points;
        for (int e = 0; e < 3; ++e) {
          const int u = t[e], v = t[(e + 1) % 3];
          surface.clear();
          at_edge(u, v, true, surface);
          if (!surface.empty()) {
            rim = {patch[k], u, v};
            continue;
          }
          sheets.clear();
          at_edge(u, v, false, sheets);
          for (const int other : sheets) {
            Place& there = pieces[other].place;
            if (there == Place::unknown) {
              there = Place::reached;
              patch.push_back(other);
            } else if (there != Place::reached) {
              known = there;
            }
          }
        }
      }
      if (known == Place::unknown && rim[0] >= 0) {
        surface.clear();
        at_edge(rim[1], rim[2], true, surface);
        known = place_at_edge(rim[0], rim[1], rim[2], surface);
      }
      if (known == Place::unknown)
        known = place_by_ray(start);
      for (const int f : patch)
        pieces[f].place = known;
    }
  }

  /// Settles which of the facets with these corners count.
  void activate(const Triangle& corners, Change& change) {
    bool first = true;
    for (const int f : coinciding(corners)) {
      Piece& piece = pieces[f];
      const bool active = first && (piece.place == Place::surface || piece.place == Place::inside);
      first = first && !active;
      if (active != piece.active)
        (active ? change.added : change.removed).push_back(f);
      piece.active = active;
    }
  }

  /// Intersects the sources from `first` on with those before them and with each other.
  std::vector<int> intersect_from(int first, std::vector<BoundingBox> boxes) {
    std::vector<int> dirty, near;
    const OverlapTree fresh(boxes);
    for (int i = first; i < std::ssize(sources); ++i) {
      if (collinear(i))
        continue;
      near.clear();
      surface_tree.meeting(boxes[i - first], 0, near);
      for (const SheetTree& sheet : sheet_trees)
        sheet.tree.meeting(boxes[i - first], sheet.first, near);
      fresh.meeting(boxes[i - first], first, near);
      for (const int j : near)
        if (j < i && (j < surface_count || !collinear(j)))
          intersect(i, j, dirty);
    }
    sheet_trees.push_back({first, fresh});
    // Merging trees of like size keeps their number logarithmic.
    while (sheet_trees.size() > 1 &&
           sheet_trees[sheet_trees.size() - 2].tree.size() <= 2 * sheet_trees.back().tree.size()) {
      sheet_trees.pop_back();
      const int from = sheet_trees.back().first;
      boxes.clear();
      for (int s = from; s < std::ssize(sources); ++s)
        boxes.push_back(box_of(s));
      sheet_trees.back().tree = OverlapTree(boxes);
    }
    keep_once(dirty);
    return dirty;
  }

  [[nodiscard]] bool collinear(int source) const {
    const Triangle& t = sources[source];
    return t[0] == t[1] || t[1] == t[2] || t[2] == t[0] || points.collinear(t[0], t[1], t[2]);
  }

  [[nodiscard]] BoundingBox box_of(int source) const {
    const Triangle& t = sources[source];
    return triangle_box(points.position(t[0]), points.position(t[1]), points.position(t[2]));
  }
};

ExactArrangement::ExactArrangement(const SurfaceMesh& surface) : data_(std::make_unique<Data>()) {
  Data& d = *data_;
  std::vector<int> number;
  number.reserve(surface.vertices.size());
  for (const Vector3& x : surface.vertices)
    number.push_back(d.points.add(x));
  d.surface_count = static_cast<int>(surface.triangles.size());
  d.size = bounds(surface).extent().norm();
  d.marks.resize(surface.triangles.size());
  d.facets_of.resize(surface.triangles.size());
  std::vector<BoundingBox> boxes;
  boxes.reserve(surface.triangles.size());
  for (int s = 0; s < d.surface_count; ++s) {
    const Triangle& t = surface.triangles[s];
    d.sources.push_back({number[t[0]], number[t[1]], number[t[2]]});
    boxes.push_back(d.box_of(s));
    d.pieces[d.add_facet({d.sources.back(), s})].active = true;
  }
  d.surface_tree = OverlapTree(boxes);
}

ExactArrangement::~ExactArrangement() = default;

ExactArrangement::Change ExactArrangement::add(const std::vector<std::array<Vector3, 3>>& triangles) {
  Data& d = *data_;
  Change change;
  if (triangles.empty())
    return change;
  const int first = static_cast<int>(d.sources.size());
  std::vector<BoundingBox> boxes;
  for (const auto& [a, b, c] : triangles) {
    const int p = d.points.add(a), q = d.points.add(b), r = d.points.add(c);
    d.sources.push_back({p, q, r});
    boxes.push_back(triangle_box(a, b, c));
  }
  d.marks.resize(d.sources.size());
  d.facets_of.resize(d.sources.size());
  const std::vector<int> dirty = d.intersect_from(first, std::move(boxes));
  change.crossed = static_cast<int>(dirty.size());
  std::vector<int> removed, added;
  for (int s = first; s < std::ssize(d.sources); ++s)
    if (!d.collinear(s) && !std::binary_search(dirty.begin(), dirty.end(), s))
      added.push_back(d.add_facet({d.sources[s], s}));
  for (const int s : dirty)
    d.refine(s, removed, added);
  d.place(added);
  for (const int f : removed)
    if (d.pieces[f].active) {
      d.pieces[f].active = false;
      change.removed.push_back(f);
    }
  for (const std::vector<int>* facets : {&removed, &added})
    for (const int f : *facets)
      d.activate(d.pieces[f].facet.points, change);
  std::sort(change.removed.begin(), change.removed.end());
  std::sort(change.added.begin(), change.added.end());
  return change;
}

int ExactArrangement::facet_count() const {
  return static_cast<int>(data_->pieces.size());
}

const ExactArrangement::Facet& ExactArrangement::facet(int facet) const {
  return data_->pieces[facet].facet;
}

bool ExactArrangement::active(int facet) const {
  return data_->pieces[facet].active;
}

bool ExactArrangement::on_surface(int facet) const {
  return data_->pieces[facet].facet.source < data_->surface_count;
}

int ExactArrangement::point_count() const {
  return data_->points.count();
}

const Vector3& ExactArrangement::position(int point) const {
  return data_->points.position(point);
}

void ExactArrangement::facets_at(int point, std::vector<int>& found) const {
  if (point < std::ssize(data_->star))
    for (const int f : data_->star[point])
      if (data_->pieces[f].active)
        found.push_back(f);
}

void ExactArrangement::facets_at_edge(int from, int to, std::vector<int>& found) const {
  const auto first = static_cast<std::ptrdiff_t>(found.size());
  data_->at_edge(from, to, true, found);
  data_->at_edge(from, to, false, found);
  found.erase(std::remove_if(found.begin() + first, found.end(), [&](int f) { return !active(f); }), found.end());
}

void ExactArrangement::sort_about_edge(int from, int to, std::vector<int>& facets) const {
  if (facets.size() < 3)
    return;
  const auto opposite = [&](int f) { return third_corner(facet(f).points, from, to); };
  const int start = opposite(facets.front());
  std::sort(facets.begin() + 1, facets.end(),
            [&](int f, int g) { return f != g && data_->before(from, to, start, opposite(f), opposite(g)); });
}

std::vector<ExactArrangement::RayCrossing> ExactArrangement::ray_from(int facet, bool along_normal) {
  Data& d = *data_;
  const Triangle own = d.pieces[facet].facet.points;
  const int from = d.points.centroid(own);
  for (int k = 0; k < ray_tries; ++k) {
    const int to = d.far_end(d.points.position(from), k);
    if (d.points.orientation(own[0], own[1], own[2], to) != (along_normal ? 1 : -1))
      continue;
    std::vector<std::pair<int, RayCrossing>> crossings; // with the point
    bool clear = true;
    for (int f = 0; f < facet_count() && clear; ++f) {
      if (!active(f) || f == facet)
        continue;
      const Triangle t = d.pieces[f].facet.points;
      const std::optional<int> crossed = d.crossing(from, to, t);
      clear = crossed.has_value();
      if (crossed.value_or(0) != 0)
        crossings.push_back({d.points.edge_plane(from, to, t), {f, *crossed > 0}});
    }
    if (!clear)
      continue;
    // On a line the lexicographic order runs one way.
    const int forward = d.points.compare(from, to);
    std::sort(crossings.begin(), crossings.end(),
              [&](const auto& a, const auto& b) { return d.points.compare(a.first, b.first) * forward > 0; });
    std::vector<RayCrossing> result;
    result.reserve(crossings.size());
    for (const auto& [point, crossed] : crossings)
      result.push_back(crossed);
    return result;
  }
  const Vector3& x = d.points.position(from);
  throw NumericalError(
      fmt::format("no ray from ({:.6g}, {:.6g}, {:.6g}) m passes clear of all edges", x.x(), x.y(), x.z()));
}

std::array<Vector3, 3> ExactArrangement::source_corners(int source) const {
  const Triangle& t = data_->sources[source];
  return {position(t[0]), position(t[1]), position(t[2])};
}

} // namespace spherecut::topology
