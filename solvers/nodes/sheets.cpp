// Sheets are open triangulations that may reach out of the body. Their rim is the zero set of the body's signed
// distance on them, found on a conforming subdivision of their triangles, finest where the surface is near.
#include "solvers/nodes/sheets.hpp"

#include "solvers/nodes/sheet_crossings.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <unordered_map>
#include <utility>

namespace spherecut::solvers {

namespace {

constexpr double rim_step = 0.35;       // edges of the subdivision that traces the rim, in units of the finest h
constexpr double sample_step = 0.5;     // of the samples of the area, in units of h
constexpr double on_surface = 1e-7;     // in units of the finest h: a sheet that ends this close reaches the surface
constexpr double corner_cosine = 0.766; // of 40 degrees

/// Joins segments (pairs of end ids) to chains of ids; closed ones repeat the first id. Open chains come first, each
/// from its lower end.
std::vector<std::vector<int>> join(const std::vector<std::array<int, 2>>& segments) {
  std::map<int, std::vector<int>> at; // segments of an id
  for (int s = 0; s < std::ssize(segments); ++s)
    for (int end : segments[s])
      at[end].push_back(s);
  std::vector<bool> used(segments.size(), false);
  std::vector<std::vector<int>> chains;
  const auto follow = [&](int from, int segment) {
    std::vector<int> chain{from};
    while (segment >= 0) {
      used[segment] = true;
      from = segments[segment][0] == from ? segments[segment][1] : segments[segment][0];
      chain.push_back(from);
      segment = -1;
      const std::vector<int>& next = at.at(from);
      if (next.size() == 2)
        for (int s : next)
          if (!used[s])
            segment = s;
    }
    chains.push_back(std::move(chain));
  };
  for (const auto& [id, list] : at)
    if (list.size() != 2)
      for (int s : list)
        if (!used[s])
          follow(id, s);
  for (const auto& [id, list] : at)
    for (int s : list)
      if (!used[s])
        follow(id, s);
  return chains;
}

// ---- front

std::vector<FrontChain> front_chains(const topology::Domain& domain, const SpacingField& spacing,
                                     const topology::Incision& incision, const BoundingBox* region) {
  const std::vector<topology::FrontSegment>& front = incision.front();
  const double tolerance = on_surface * spacing.finest();
  // Ends are equal to the bit where segments meet at a vertex of the sheet.
  std::map<std::array<double, 4>, int> ids;
  std::vector<Vector3> points;
  const auto id_of = [&](const Vector3& x, int sheet) {
    const auto [found, fresh] =
        ids.emplace(std::array<double, 4>{x.x(), x.y(), x.z(), double(sheet)}, static_cast<int>(points.size()));
    if (fresh)
      points.push_back(x);
    return found->second;
  };
  std::vector<std::array<int, 2>> segments;
  std::map<std::array<int, 2>, int> segment_of; // by ends
  for (int s = 0; s < std::ssize(front); ++s) {
    const topology::FrontSegment& piece = front[s];
    if (!within(region, box_of(piece.from, piece.to)) || piece.from == piece.to ||
        domain.signed_distance(0.5 * (piece.from + piece.to)) > -tolerance)
      continue;
    segments.push_back({id_of(piece.from, piece.sheet), id_of(piece.to, piece.sheet)});
    segment_of[{std::min(segments.back()[0], segments.back()[1]), std::max(segments.back()[0], segments.back()[1])}] =
        s;
  }
  std::vector<FrontChain> chains;
  for (std::vector<int>& chain : join(segments)) {
    const auto piece_at = [&](std::size_t k) -> const topology::FrontSegment& {
      return front[segment_of.at({std::min(chain[k], chain[k + 1]), std::max(chain[k], chain[k + 1])})];
    };
    if (piece_at(0).from != points[chain[0]]) // along the front, the sheet on the left
      std::reverse(chain.begin(), chain.end());
    FrontChain result;
    result.sheet = piece_at(0).sheet;
    result.closed = chain.size() > 2 && chain.front() == chain.back();
    for (int id : chain)
      result.points.push_back(points[id]);
    for (std::size_t k = 0; k + 1 < chain.size(); ++k) {
      const Vector3 along = (result.points[k + 1] - result.points[k]).normalized();
      const Vector3 middle = 0.5 * (result.points[k] + result.points[k + 1]);
      const double reach = (result.points[k + 1] - result.points[k]).norm();
      const auto frame = incision.front_frame(middle, reach);
      const Vector3 normal = frame ? frame->normal : along.unitOrthogonal();
      result.ahead.push_back(along.cross(normal).normalized());
      result.normal.push_back(normal);
    }
    const std::size_t pieces = result.ahead.size();
    result.corner.assign(result.points.size(), false);
    for (std::size_t k = 0; k <= pieces; ++k) {
      if (!result.closed && (k == 0 || k == pieces))
        continue;
      const Vector3 &before = result.ahead[(k + pieces - 1) % pieces], &after = result.ahead[k % pieces];
      result.corner[k] = before.dot(after) < corner_cosine;
    }
    chains.push_back(std::move(result));
  }
  return chains;
}

// ---- rim

/// Traces the zero set of the signed distance on one sheet.
class RimTracer {
 public:
  RimTracer(const topology::Domain& domain, const SpacingField& spacing, const topology::SurfaceMesh& sheet,
            const BoundingBox* region)
      : domain_(domain), sheet_(sheet), region_(region), tolerance_(on_surface * spacing.finest()),
        points_(sheet.vertices), distances_(sheet.vertices.size(), std::numeric_limits<double>::quiet_NaN()) {
    double longest = 0;
    for (const Triangle& t : sheet.triangles)
      for (int e = 0; e < 3; ++e)
        longest = std::max(longest, (sheet.vertices[t[e]] - sheet.vertices[t[(e + 1) % 3]]).norm());
    levels_ = std::clamp(static_cast<int>(std::ceil(std::log2(longest / (rim_step * spacing.finest())))), 0, 16);
  }

  std::vector<RimChain> trace(int sheet_index) {
    for (int t = 0; t < std::ssize(sheet_.triangles); ++t) {
      const Triangle& v = sheet_.triangles[t];
      if (within(region_, box_of(points_[v[0]], points_[v[1]], points_[v[2]]))) {
        normal_ = topology::triangle_normal(sheet_, t);
        visit(v, levels_);
      }
    }
    std::vector<RimChain> chains;
    for (const std::vector<int>& ids : join(segments_)) {
      RimChain chain;
      chain.sheet = sheet_index;
      chain.closed = ids.size() > 2 && ids.front() == ids.back();
      for (int id : ids) {
        chain.points.push_back(crossings_[id]);
        chain.normals.push_back(crossing_normals_[id].normalized());
      }
      chain.along.assign(ids.size(), Vector3::Zero());
      chains.push_back(std::move(chain));
    }
    return chains;
  }

 private:
  double distance(int point) {
    double& d = distances_[point];
    if (std::isnan(d))
      d = domain_.signed_distance(points_[point]);
    return d;
  }

  int middle(int a, int b) {
    const auto [found, fresh] = middles_.emplace(key(a, b), static_cast<int>(points_.size()));
    if (fresh) {
      points_.emplace_back(0.5 * (points_[a] + points_[b]));
      distances_.push_back(std::numeric_limits<double>::quiet_NaN());
    }
    return found->second;
  }

  static std::uint64_t key(int a, int b) {
    return (static_cast<std::uint64_t>(std::min(a, b)) << 32) | static_cast<std::uint64_t>(std::max(a, b));
  }

  void visit(const Triangle& v, int level) {
    const Vector3 &a = points_[v[0]], &b = points_[v[1]], &c = points_[v[2]];
    if (!within(region_, box_of(a, b, c)))
      return;
    const Vector3 centre = (a + b + c) / 3;
    const double radius =
        std::sqrt(std::max({(a - centre).squaredNorm(), (b - centre).squaredNorm(), (c - centre).squaredNorm()}));
    if (std::abs(domain_.signed_distance(centre)) > 1.2 * radius + tolerance_)
      return;
    if (level > 0) {
      const int ab = middle(v[0], v[1]), bc = middle(v[1], v[2]), ca = middle(v[2], v[0]);
      visit({v[0], ab, ca}, level - 1);
      visit({ab, v[1], bc}, level - 1);
      visit({ca, bc, v[2]}, level - 1);
      visit({ab, bc, ca}, level - 1);
      return;
    }
    std::array<int, 2> ends{-1, -1};
    int found = 0;
    for (int e = 0; e < 3; ++e) {
      const int p = v[e], q = v[(e + 1) % 3];
      if ((distance(p) < -tolerance_) != (distance(q) < -tolerance_))
        ends[found++] = crossing(p, q);
    }
    if (found == 2)
      segments_.push_back(ends);
  }

  int crossing(int p, int q) {
    const auto [entry, fresh] = crossing_of_.emplace(key(p, q), static_cast<int>(crossings_.size()));
    if (!fresh) {
      crossing_normals_[entry->second] += normal_;
      return entry->second;
    }
    if (distance(p) >= -tolerance_)
      std::swap(p, q); // p inside
    const double level = distance(q) > 0 ? 0 : -tolerance_;
    Vector3 a = points_[p], b = points_[q];
    double fa = distance(p) - level, fb = distance(q) - level;
    Vector3 x = b;
    for (int step = 0; step < 60 && fb != 0 && (b - a).norm() > 1e-4 * tolerance_; ++step) {
      // False position, every third time a bisection.
      x = step % 3 == 2 ? Vector3(0.5 * (a + b)) : Vector3(a + fa / (fa - fb) * (b - a));
      const double f = domain_.signed_distance(x) - level;
      if (std::abs(f) < 1e-6 * tolerance_)
        break;
      (f < 0 ? a : b) = x;
      (f < 0 ? fa : fb) = f;
    }
    crossings_.push_back(x);
    crossing_normals_.push_back(normal_);
    return entry->second;
  }

  const topology::Domain& domain_;
  const topology::SurfaceMesh& sheet_;
  const BoundingBox* region_;
  double tolerance_;
  int levels_ = 0;
  Vector3 normal_ = Vector3::Zero(); // of the triangle at hand
  std::vector<Vector3> points_;
  std::vector<double> distances_;
  std::unordered_map<std::uint64_t, int> middles_, crossing_of_;
  std::vector<Vector3> crossings_, crossing_normals_;
  std::vector<std::array<int, 2>> segments_;
};

/// Makes the places where sharp edges pass through the sheet points of its rim.
void insert_corners(const std::vector<SharpCrossing>& corners, const SpacingField& spacing,
                    std::vector<RimChain>& chains) {
  for (const SharpCrossing& corner : corners) {
    double best = 0.5 * spacing(corner.point);
    RimChain* nearest = nullptr;
    std::ptrdiff_t segment = 0;
    for (RimChain& chain : chains) {
      if (chain.sheet != corner.sheet)
        continue;
      for (std::size_t k = 0; k + 1 < chain.points.size(); ++k) {
        const double distance = distance_to_segments(corner.point, {{chain.points[k], chain.points[k + 1]}});
        if (distance < best) {
          best = distance;
          nearest = &chain;
          segment = static_cast<std::ptrdiff_t>(k);
        }
      }
    }
    if (nearest == nullptr)
      continue;
    nearest->points.insert(nearest->points.begin() + segment + 1, corner.point);
    nearest->normals.insert(nearest->normals.begin() + segment + 1, corner.normal);
    nearest->along.insert(nearest->along.begin() + segment + 1, corner.along);
  }
  // A closed chain starts at a corner when it has one.
  for (RimChain& chain : chains) {
    if (!chain.closed)
      continue;
    const auto first =
        std::find_if(chain.along.begin(), chain.along.end(), [](const Vector3& v) { return !v.isZero(); });
    if (first == chain.along.end())
      continue;
    const std::ptrdiff_t shift = first - chain.along.begin();
    for (std::vector<Vector3>* list : {&chain.points, &chain.normals, &chain.along}) {
      list->pop_back();
      std::rotate(list->begin(), list->begin() + shift, list->end());
      list->push_back(list->front());
    }
  }
}

// ---- area

void sample_sheet(const topology::Domain& domain, const SpacingField& spacing, const topology::SurfaceMesh& sheet,
                  int index, const BoundingBox* region, std::vector<SheetSample>& samples) {
  std::vector<std::array<Vector3, 3>> pieces;
  for (int t = 0; t < std::ssize(sheet.triangles); ++t) {
    const Triangle& v = sheet.triangles[t];
    const Vector3 normal = topology::triangle_normal(sheet, t);
    pieces.assign(1, {sheet.vertices[v[0]], sheet.vertices[v[1]], sheet.vertices[v[2]]});
    while (!pieces.empty()) {
      auto [a, b, c] = pieces.back();
      pieces.pop_back();
      if (!within(region, box_of(a, b, c)))
        continue;
      const Vector3 centre = (a + b + c) / 3;
      const double ab = (b - a).squaredNorm(), bc = (c - b).squaredNorm(), ca = (a - c).squaredNorm();
      const double longest = std::sqrt(std::max({ab, bc, ca})), distance = domain.signed_distance(centre);
      if (distance > longest)
        continue;
      const double h = spacing(centre);
      if (longest <= sample_step * h) {
        const double area = 0.5 * (b - a).cross(c - a).norm();
        const double size = std::sqrt(area), filled = size > 0 ? std::clamp(0.5 - distance / size, 0.0, 1.0) : 0.0;
        if (filled > 0)
          samples.push_back({centre, normal, h, filled * area / (h * h), index});
        continue;
      }
      if (bc >= ab && bc >= ca)
        std::tie(a, b, c) = std::make_tuple(b, c, a);
      else if (ca >= ab && ca >= bc)
        std::tie(a, b, c) = std::make_tuple(c, a, b);
      const Vector3 m = 0.5 * (a + b); // of the longest edge
      pieces.push_back({a, m, c});
      pieces.push_back({m, b, c});
    }
  }
}

} // namespace

MeasuredCurve::MeasuredCurve(std::vector<Vector3> points, const SpacingField& spacing) : points_(std::move(points)) {
  double measure = 0;
  for (std::size_t k = 0; k < points_.size(); ++k) {
    if (k > 0) {
      const Vector3 a = points_[k - 1], ab = points_[k] - a;
      const double length = ab.norm();
      const int steps = std::clamp(static_cast<int>(length / (0.3 * spacing.finest())), 1, 64);
      for (int step = 0; step < steps; ++step)
        measure += length / steps / spacing(a + (step + 0.5) / steps * ab);
    }
    measures_.push_back(measure);
  }
}

MeasuredCurve::Place MeasuredCurve::at(double measure) const {
  const auto above = std::upper_bound(measures_.begin() + 1, measures_.end() - 1, measure);
  const int k = static_cast<int>(above - measures_.begin());
  const double step = measures_[k] - measures_[k - 1];
  const double t = step > 0 ? std::clamp((measure - measures_[k - 1]) / step, 0.0, 1.0) : 0.0;
  return {k - 1, t, (1 - t) * points_[k - 1] + t * points_[k]};
}

SheetLayout lay_out_sheets(const topology::Domain& domain, const SharpFeatures& features, const SpacingField& spacing,
                           const topology::Incision& incision, const topology::SurfaceMesh& surface,
                           const BoundingBox* region) {
  SheetLayout layout;
  layout.fronts = front_chains(domain, spacing, incision, region);
  layout.edges = edge_crossings(domain, features, spacing, incision, surface, region);
  for (int s = 0; s < std::ssize(incision.sheets()); ++s) {
    const topology::SurfaceMesh& sheet = incision.sheets()[s];
    for (RimChain& chain : RimTracer(domain, spacing, sheet, region).trace(s))
      layout.rims.push_back(std::move(chain));
    sample_sheet(domain, spacing, sheet, s, region, layout.samples);
  }
  insert_corners(layout.edges, spacing, layout.rims);
  for (RimChain& chain : layout.rims)
    if (!chain.closed)
      for (int end : {0, 1}) {
        const Vector3& x = end == 0 ? chain.points.front() : chain.points.back();
        chain.at_front[end] = incision.front_frame(x, 0.05 * spacing(x)).has_value();
      }
  layout.crossings = sheet_crossings(incision, region);
  return layout;
}

} // namespace spherecut::solvers
