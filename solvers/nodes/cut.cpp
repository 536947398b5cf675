// Notation: p point of a sheet, n its unit normal, h the spacing at p. A pair at p is the two nodes p +- lip_offset h
// n, the outward normals of which point at the sheet, -+ n. Distances between pairs are measured between their points
// p, on one sheet: two sheets closer than a spacing do not crowd each other.
#include "solvers/nodes/cut.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <utility>

namespace spherecut::solvers {

namespace {

// In units of h.
constexpr double station_crowding = 0.6; // between new pairs of rings and rims
constexpr double grown_crowding = 0.75;  // of such pairs against those placed before the cut grew
constexpr double single_crowding = 0.7;  // of the ring ahead
constexpr double taken_crowding = 0.4;   // of pairs against seeds
constexpr double lips_facing = 0.5;      // of lip nodes of different sheets that see each other
constexpr double step_crowding = 0.87;   // as between other nodes: see node_filler.cpp
constexpr double strip_crowding = 0.88;
constexpr double step_length = 0.93;
constexpr double surface_clearance = 0.3; // of rings
constexpr double above_sheet =
    0.15; // of other pairs: the rim keeps its neighbours away, the surface may run along a sheet
constexpr double near_front = 0.8; // pairs between the ring and the sheet's interior
constexpr double same_place = 0.2; // a previous node this near to a place of the ring ahead stands in for it
constexpr int candidates = 14;

struct Pair {
  Vector3 point, normal;
  double spacing;
  int sheet;
};

class Chooser {
 public:
  Chooser(const topology::Domain& domain, const SprinkleOptions& options, const SharpFeatures& features,
          const topology::SurfaceMesh& surface, const SheetLayout& layout, const Surroundings& there)
      : domain_(domain), incision_(*options.incision), spacing_(options.spacing), layout_(layout), there_(there),
        singles_(spacing_.finest(), spacing_.slope), lips_(spacing_.finest(), spacing_.slope),
        previous_(spacing_.finest(), spacing_.slope), random_(options.random_seed), ring_ahead_(options.ring_ahead) {
    const std::size_t sheets = incision_.sheets().size();
    fresh_.assign(sheets, NodeGrid(spacing_.finest(), spacing_.slope));
    settled_ = fresh_;
    for (const SharpCurve& curve : features.curves)
      for (std::size_t k = 0; k + 1 < curve.vertices.size(); ++k)
        sharp_edges_.push_back({surface.vertices[curve.vertices[k]], surface.vertices[curve.vertices[k + 1]]});
    if (there.previous == nullptr)
      return;
    for (int j : there.lips) {
      const Vector3& x = there.previous->positions[j];
      const double h = spacing_(x);
      if (const auto at = incision_.closest(x, 0.01 * h)) {
        settled_[at->sheet].add(at->point, h);
        keep_lip(x, h, at->sheet);
      }
    }
    for (int j = 0; j < there.previous->size(); ++j)
      if (there.previous->kinds[j] != NodeKind::lip) {
        previous_.add(there.previous->positions[j], spacing_(there.previous->positions[j]));
        previous_kinds_.push_back(there.previous->kinds[j]);
      }
  }

  std::vector<CutNode> choose() {
    for (const FrontChain& chain : layout_.fronts)
      ring_behind(chain);
    if (ring_ahead_)
      for (const FrontChain& chain : layout_.fronts)
        ring_ahead(chain);
    for (const RimChain& chain : layout_.rims)
      line(chain);
    fill();
    return std::move(nodes_);
  }

 private:
  [[nodiscard]] bool allowed(const Vector3& x) const { return there_.region == nullptr || there_.region->contains(x); }

  // ---- pairs

  [[nodiscard]] bool pair_fits(const Vector3& p, double h, int sheet, double fresh_limit, double settled_limit) const {
    return allowed(p) && !fresh_[sheet].crowded(p, h, fresh_limit) && !settled_[sheet].crowded(p, h, settled_limit) &&
           !there_.taken->crowded(p, h, taken_crowding) &&
           distance_to_segments(p, layout_.crossings) >= crossing_clearance * h;
  }

  /// Point of the body's surface off the sheet by `offset` on the given side; along the sharp edge that p lies on.
  [[nodiscard]] Vector3 on_surface(const Vector3& p, const Vector3& n, const Vector3& edge, double offset) const {
    if (!edge.isZero())
      return p + offset / edge.dot(n) * edge;
    Vector3 x = p + offset * n;
    for (int correction = 0; correction < 4; ++correction) {
      x = domain_.closest_surface_point(x);
      const double missing = offset - (x - p).dot(n);
      if (std::abs(missing) < 1e-6 * std::abs(offset))
        break;
      const Vector3 outward = domain_.normal(x), along = n - n.dot(outward) * outward;
      if (along.squaredNorm() < 0.01)
        break;
      x += missing / along.dot(n) * along;
    }
    return x;
  }

  void keep_lip(const Vector3& x, double h, int sheet) {
    lips_.add(x, h);
    lip_places_.emplace_back(x, sheet);
  }

  /// Whether x sees a lip node of another sheet at close range.
  [[nodiscard]] bool faces_another(const Vector3& x, double h, int sheet) const {
    bool found = false;
    if (incision_.sheets().size() > 1)
      lips_.for_each_within(x, h, lips_facing * h, [&](int j, double) {
        found |= lip_places_[j].second != sheet && !incision_.blocks(x, lip_places_[j].first);
      });
    return found;
  }

  /// Adds the pair unless its nodes would not lie on the two sides of the sheet, or would crowd those of another.
  bool add_pair(const Vector3& p, const Vector3& n, int sheet, bool on_rim = false,
                const Vector3& edge = Vector3::Zero()) {
    const double h = spacing_(p), offset = lip_offset * h;
    std::array<Vector3, 2> x{p + offset * n, p - offset * n};
    if (on_rim)
      x = {on_surface(p, n, edge, offset), on_surface(p, n, edge, -offset)};
    // On a sharp fold one of the two would lie on the other face.
    const auto on_sheet = [&](const Vector3& at) {
      const auto face = incision_.closest(at, offset);
      return face && face->distance < 0.5 * offset;
    };
    if (!incision_.blocks(x[0], x[1]) || on_sheet(x[0]) || on_sheet(x[1]) || faces_another(x[0], h, sheet) ||
        faces_another(x[1], h, sheet))
      return false;
    keep_lip(x[0], h, sheet);
    keep_lip(x[1], h, sheet);
    nodes_.push_back({x[0], h, NodeKind::lip, -n});
    nodes_.push_back({x[1], h, NodeKind::lip, n});
    fresh_[sheet].add(p, h);
    pairs_.push_back({p, n, h, sheet});
    return true;
  }

  /// Distance to the front of the given sheet, or to any other's within crossing_clearance.
  [[nodiscard]] bool clear_of_front(const Vector3& p, double h, int sheet, double distance) const {
    const auto frame = incision_.front_frame(p, distance * h);
    return !frame || (incision_.front()[frame->segment].sheet != sheet && frame->distance >= crossing_clearance * h);
  }

  // ---- rings along the front

  /// Calls visit(point of the front, unit direction ahead, factor behind, factor ahead): at a corner the ring on the
  /// inner side of the turn is moved out along the bisector.
  template <class Visitor>
  void along_front(const FrontChain& chain, Visitor&& visit) const {
    const MeasuredCurve curve(chain.points, spacing_);
    const int last = static_cast<int>(chain.points.size()) - 1;
    int begin = 0;
    for (int end = 1; end <= last; ++end) {
      if (end < last && !chain.corner[end])
        continue;
      const double from = curve.measure(begin), to = curve.measure(end);
      const bool whole = chain.closed && begin == 0 && end == last && !chain.corner[0];
      const int steps = std::max(whole ? 3 : 1, static_cast<int>(std::lround(to - from)));
      for (int k = 0; k < steps; ++k) {
        if (k == 0 && chain.corner[begin])
          at_corner(chain, begin, visit);
        else if (k > 0 || chain.closed) {
          const MeasuredCurve::Place place = curve.at(from + (to - from) * k / steps);
          const auto frame = incision_.front_frame(place.point, spacing_(place.point));
          if (frame)
            visit(place.point, frame->ahead, 1.0, 1.0);
        }
      }
      begin = end;
    }
  }

  template <class Visitor>
  void at_corner(const FrontChain& chain, int k, Visitor&& visit) const {
    const std::size_t pieces = chain.ahead.size();
    const Vector3 &before = chain.ahead[(k + pieces - 1) % pieces], &after = chain.ahead[k % pieces];
    const Vector3 sum = before + after;
    if (sum.norm() < 0.2)
      return;
    const double inner = 2 / sum.norm(); // 1 / cos of half the turn
    const Vector3 along = chain.points[k % pieces + 1] - chain.points[k % pieces];
    const bool convex = (after - before).dot(along) > 0;
    visit(chain.points[k], sum.normalized(), convex ? inner : 1.0, convex ? 1.0 : inner);
  }

  void ring_behind(const FrontChain& chain) {
    along_front(chain, [&](const Vector3& p, const Vector3& ahead, double behind, double) {
      const double h = spacing_(p);
      // Where a pair of an earlier front is too near the half offset may still leave room.
      for (const double offset : {ring_offset, 0.6 * ring_offset}) {
        const auto at = incision_.closest(p - offset * behind * h * ahead, 0.6 * h);
        if (at && at->sheet == chain.sheet && !at->on_border &&
            domain_.signed_distance(at->point) <= -surface_clearance * h &&
            clear_of_front(at->point, h, chain.sheet, 0.8 * offset) &&
            pair_fits(at->point, h, chain.sheet, station_crowding, grown_crowding) &&
            add_pair(at->point, at->normal, chain.sheet))
          return;
      }
    });
  }

  [[nodiscard]] bool stood_in(const Vector3& x, double h, NodeKind kind) const {
    bool found = false;
    if (previous_.size() > 0)
      previous_.for_each_within(x, h, same_place * h, [&](int j, double) { found |= previous_kinds_[j] == kind; });
    return found;
  }

  [[nodiscard]] bool single_fits(const Vector3& x, double h) const {
    return allowed(x) && !incision_.closest(x, sheet_clearance * h) && !singles_.crowded(x, h, single_crowding) &&
           !lips_.crowded(x, h, single_crowding) && !there_.taken->crowded(x, h, single_crowding);
  }

  void add_single(const Vector3& x, double h, NodeKind kind, const Vector3& normal) {
    singles_.add(x, h);
    if (!stood_in(x, h, kind))
      nodes_.push_back({x, h, kind, normal});
  }

  void ring_ahead(const FrontChain& chain) {
    along_front(chain, [&](const Vector3& p, const Vector3& direction, double, double ahead) {
      const Vector3 x = p + ring_offset * ahead * spacing_(p) * direction;
      const double h = spacing_(x);
      if (domain_.signed_distance(x) <= -surface_clearance * h && single_fits(x, h))
        add_single(x, h, NodeKind::interior, Vector3::Zero());
    });
  }

  // ---- rims

  void line(const RimChain& chain) {
    const MeasuredCurve curve(chain.points, spacing_);
    const int last = static_cast<int>(chain.points.size()) - 1;
    std::vector<int> stops{0};
    for (int k = 1; k < last; ++k)
      if (!chain.along[k].isZero())
        stops.push_back(k);
    stops.push_back(last);
    for (int k : stops) // sharp edges of the body first: there is no other place for them
      if (!chain.along[k].isZero())
        station(chain, curve, curve.measure(k), station_crowding, k);
    for (std::size_t s = 0; s + 1 < stops.size(); ++s) {
      double from = curve.measure(stops[s]), to = curve.measure(stops[s + 1]);
      const bool front_first = s == 0 && chain.at_front[0], front_last = s + 2 == stops.size() && chain.at_front[1];
      if (front_first)
        at_front(chain, curve, from, 1);
      if (front_last)
        at_front(chain, curve, to, -1);
      from += front_first ? ring_offset : 0;
      to -= front_last ? ring_offset : 0;
      const int steps = std::max(chain.closed && stops.size() == 2 ? 3 : 1, static_cast<int>(std::lround(to - from)));
      for (int k = 0; k <= steps && to > from; ++k)
        station(chain, curve, from + (to - from) * k / steps, station_crowding);
    }
    for (double at = 0; at < curve.length(); at += 0.25) // places that the regular steps have missed
      station(chain, curve, at, strip_crowding);
    for (int end : {0, 1})
      if (ring_ahead_ && chain.at_front[end])
        ahead_on_surface(chain, end);
  }

  /// The pair of a rim that is nearest to the front.
  void at_front(const RimChain& chain, const MeasuredCurve& curve, double end, int direction) {
    if (!station(chain, curve, end + direction * ring_offset, station_crowding))
      station(chain, curve, end + direction * 0.6 * ring_offset, station_crowding);
  }

  bool station(const RimChain& chain, const MeasuredCurve& curve, double measure, double crowding, int point = -1) {
    if (measure < 0 || measure > curve.length())
      return false;
    const MeasuredCurve::Place place = curve.at(measure);
    const Vector3 p = point >= 0 ? chain.points[point] : place.point;
    const double h = spacing_(p);
    if (!pair_fits(p, h, chain.sheet, crowding, std::max(crowding, grown_crowding)) ||
        !clear_of_front(p, h, chain.sheet, 0.45 * ring_offset))
      return false;
    if (point >= 0)
      return add_pair(p, chain.normals[point], chain.sheet, true, chain.along[point]);
    // The chord is straight where the surface and the sheet may not be.
    const Vector3 n =
        ((1 - place.t) * chain.normals[place.segment] + place.t * chain.normals[place.segment + 1]).normalized();
    Vector3 on_both = p;
    for (int correction = 0; correction < 4; ++correction) {
      const auto on_sheet = incision_.closest(on_both, 0.1 * h);
      if (!on_sheet || on_sheet->sheet != chain.sheet)
        return false;
      on_both = on_sheet->point;
      const Vector3 outward = domain_.normal(on_both);
      const Vector3 along = outward - outward.dot(on_sheet->normal) * on_sheet->normal;
      const double distance = domain_.signed_distance(on_both);
      if (std::abs(distance) < 1e-12 * h || along.squaredNorm() < 0.01)
        break;
      on_both -= distance / along.squaredNorm() * along;
    }
    return add_pair(on_both, n, chain.sheet, true);
  }

  void ahead_on_surface(const RimChain& chain, int end) {
    const std::size_t count = chain.points.size();
    const Vector3& tip = end == 0 ? chain.points.front() : chain.points.back();
    const double h_tip = spacing_(tip);
    std::size_t k = 1; // the direction is that of the last quarter of a spacing
    while (k + 1 < count && ((end == 0 ? chain.points[k] : chain.points[count - 1 - k]) - tip).norm() < 0.25 * h_tip)
      ++k;
    const Vector3 direction = (tip - (end == 0 ? chain.points[k] : chain.points[count - 1 - k])).normalized();
    const Vector3 x = domain_.closest_surface_point(tip + ring_offset * h_tip * direction);
    const double h = spacing_(x);
    if (distance_to_segments(x, sharp_edges_) >= surface_clearance * h && single_fits(x, h))
      add_single(x, h, NodeKind::surface, domain_.normal(x));
  }

  // ---- area

  double uniform() { return static_cast<double>(random_() >> 11) * 0x1p-53; }

  void advance(std::size_t next) {
    for (; next < pairs_.size(); ++next) {
      const Pair from = pairs_[next];
      const Vector3 u = from.normal.unitOrthogonal(), v = from.normal.cross(u);
      const double turn = uniform();
      for (int k = 0; k < candidates; ++k) {
        const double angle = 2 * std::numbers::pi * (k + turn) / candidates;
        const Vector3 direction = std::cos(angle) * u + std::sin(angle) * v;
        double step = step_length * from.spacing;
        for (int attempt = 0; attempt < 3; ++attempt)
          step = 0.5 * step_length * (from.spacing + spacing_(from.point + step * direction));
        const auto at = incision_.closest(from.point + step * direction, 0.5 * from.spacing);
        if (!at || at->sheet != from.sheet || at->on_border)
          continue;
        const double h = spacing_(at->point);
        if (pair_fits(at->point, h, from.sheet, step_crowding, step_crowding) &&
            domain_.signed_distance(at->point) <= -above_sheet * h &&
            clear_of_front(at->point, h, from.sheet, near_front))
          add_pair(at->point, at->normal, from.sheet);
      }
    }
  }

  void fill() {
    advance(0);
    const auto sweep = [&](const SheetSample& sample, double limit, double from_front, double from_surface) {
      const double h = sample.spacing;
      if (pair_fits(sample.point, h, sample.sheet, limit, limit) &&
          domain_.signed_distance(sample.point) <= -from_surface * h &&
          clear_of_front(sample.point, h, sample.sheet, from_front) &&
          add_pair(sample.point, sample.normal, sample.sheet))
        advance(pairs_.size() - 1);
    };
    for (const SheetSample& sample : layout_.samples)
      sweep(sample, strip_crowding, 0.8 * ring_offset, above_sheet);
    // A sheet smaller than its rings gets a pair all the same.
    for (const SheetSample& sample : layout_.samples)
      if (fresh_[sample.sheet].size() + settled_[sample.sheet].size() == 0)
        sweep(sample, strip_crowding, 0.1, 0.1);
  }

  const topology::Domain& domain_;
  const topology::Incision& incision_;
  const SpacingField& spacing_;
  const SheetLayout& layout_;
  const Surroundings& there_;
  std::vector<NodeGrid> fresh_, settled_; // pairs of this call and of before, per sheet
  NodeGrid singles_, lips_, previous_;
  std::vector<std::pair<Vector3, int>> lip_places_; // with their sheets
  std::vector<NodeKind> previous_kinds_;
  std::vector<std::array<Vector3, 2>> sharp_edges_;
  std::vector<Pair> pairs_;
  std::vector<CutNode> nodes_;
  std::mt19937_64 random_;
  bool ring_ahead_;
};

} // namespace

std::vector<CutNode> choose_cut_nodes(const topology::Domain& domain, const SprinkleOptions& options,
                                      const SharpFeatures& features, const topology::SurfaceMesh& surface,
                                      const SheetLayout& layout, const Surroundings& there) {
  return Chooser(domain, options, features, surface, layout, there).choose();
}

} // namespace spherecut::solvers
