#include "topology/incision/incision.hpp"

#include "topology/base/errors.hpp"
#include "topology/incision/sheet_front.hpp"
#include "topology/incision/sight_work.hpp"
#include "topology/search/box_tree.hpp"
#include "topology/search/proximity.hpp"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>
#include <fmt/format.h>
#include <iterator>
#include <mutex>
#include <span>
#include <utility>

namespace spherecut::topology {

namespace {

constexpr int any_sheet = -1;

/// A triangle as a plane and two barycentric coordinates, affine functions of the position relative to the tree's
/// origin. What a sight line is tested against.
struct Wall {
  Vector3 normal;                    // unit
  Vector3 along_u, along_v;          // gradients of the barycentric coordinates u and v, 1/m
  double height, u_offset, v_offset; // at the origin, with the sign turned
  double steepest;                   // 1/m, largest gradient of u, v and 1 - u - v

  Wall(const Vector3& a, const Vector3& b, const Vector3& c) {
    const Vector3 ab = b - a, ac = c - a, area_vector = ab.cross(ac);
    const double squared = area_vector.squaredNorm();
    normal = area_vector / std::sqrt(squared);
    along_u = ac.cross(area_vector) / squared;
    along_v = area_vector.cross(ab) / squared;
    height = normal.dot(a);
    u_offset = along_u.dot(a);
    v_offset = along_v.dot(a);
    steepest = std::max({along_u.norm(), along_v.norm(), (along_u + along_v).norm()});
  }

  /// Whether the segment p q meets the triangle. Heights within `flat` m count as on the plane.
  [[nodiscard]] bool meets(const Vector3& p, const Vector3& q, double flat) const {
    const double at_p = normal.dot(p) - height, at_q = normal.dot(q) - height;
    if (std::min(at_p, at_q) > flat || std::max(at_p, at_q) < -flat)
      return false;
    // Neighbours overlap by this share of a triangle, and by what rounding of the heights moves the crossing.
    constexpr double overlap = 1e-9;
    if (std::abs(at_p) <= flat && std::abs(at_q) <= flat)
      return meets_in_plane(p, q, overlap + flat * steepest);
    const double rise = at_p - at_q;
    const Vector3 crossing = p + std::clamp(at_p / rise, 0.0, 1.0) * (q - p);
    const double slack = overlap + 1e-3 * flat * steepest * (q - p).norm() / std::abs(rise);
    const double u = along_u.dot(crossing) - u_offset, v = along_v.dot(crossing) - v_offset;
    return u >= -slack && v >= -slack && u + v <= 1 + slack;
  }

  /// Whether y and the box centre +- half lie on one side of the plane, further off than heights count as on it.
  [[nodiscard]] bool is_beside(const Vector3& centre, const Vector3& half, const Vector3& y, double flat) const {
    const double at_y = normal.dot(y) - height, at_centre = normal.dot(centre) - height;
    const double spread = normal.cwiseAbs().dot(half);
    return std::min(at_y, at_centre - spread) > 2 * flat || std::max(at_y, at_centre + spread) < -2 * flat;
  }

  [[nodiscard]] bool meets_in_plane(const Vector3& p, const Vector3& q, double slack) const {
    const double u_p = along_u.dot(p) - u_offset, v_p = along_v.dot(p) - v_offset;
    const double u_q = along_u.dot(q) - u_offset, v_q = along_v.dot(q) - v_offset;
    double from = 0, to = 1; // part of the segment inside the edges looked at so far
    for (const auto& [start, end] :
         {std::pair(u_p, u_q), std::pair(v_p, v_q), std::pair(1 - u_p - v_p, 1 - u_q - v_q)}) {
      if (start < -slack && end < -slack)
        return false;
      if (start < -slack)
        from = std::max(from, (-slack - start) / (end - start));
      else if (end < -slack)
        to = std::min(to, (start + slack) / (start - end));
    }
    return from <= to;
  }
};

/// An order of segments that does not depend on their numbers.
bool before(const FrontSegment& a, const FrontSegment& b) {
  const auto key = [](const FrontSegment& s) {
    return std::array{s.from.x(), s.from.y(), s.from.z(), s.to.x(), s.to.y(), s.to.z()};
  };
  return key(a) < key(b);
}

Eigen::Vector3f single(const Vector3& x) {
  return x.cast<float>();
}

/// Triangles that have blocked sight lines from one place, the last first. Lines from there to places beside one
/// another are mostly blocked by the same few, which are asked before the whole tree.
struct Blockers {
  static constexpr int most = 12;
  std::array<int, most> walls{};
  int count = 0;
  void come_first(int at) { std::rotate(walls.begin(), walls.begin() + at, walls.begin() + at + 1); }
  void add(int wall) {
    count = std::min(count + 1, most);
    walls[count - 1] = wall;
    come_first(count - 1);
  }
};

/// A way from one eye over a place of the front to the other one.
struct WayOver {
  double length = 0, share = 0; // m; place on the segment, 0 to 1
  int segment = -1;
  Vector3 over = Vector3::Zero(); // m
};

/// The shorter ways, no more than fit, and of those beside one another that come in succession the shortest alone.
/// Their memory is a thread's own.
class ShortestWays {
 public:
  static constexpr std::size_t most = 64;
  /// Ways no farther apart than `beside` m are beside one another.
  void clear(double beside) {
    squared_beside_ = beside * beside;
    count_ = 0;
    has_last_ = false;
  }
  void add(const WayOver& way) {
    if (has_last_ && are_beside(way, last_)) {
      if (is_shorter(way, last_))
        last_ = way;
      return;
    }
    keep_last();
    last_ = way;
    has_last_ = true;
  }
  /// A way of that length, m, or longer is not wanted.
  [[nodiscard]] double limit(double otherwise) const { return count_ == most ? ways_.front().length : otherwise; }
  /// The shortest first. The next call is clear().
  std::span<WayOver> in_order() {
    keep_last();
    std::sort_heap(ways_.begin(), end(), is_shorter);
    return {ways_.data(), count_};
  }
  [[nodiscard]] bool are_beside(const WayOver& a, const WayOver& b) const {
    return (a.over - b.over).squaredNorm() <= squared_beside_;
  }

 private:
  static bool is_shorter(const WayOver& a, const WayOver& b) {
    return a.length != b.length ? a.length < b.length : a.segment < b.segment;
  }
  std::array<WayOver, most + 1>::iterator end() { return ways_.begin() + static_cast<std::ptrdiff_t>(count_); }
  void keep_last() {
    if (!has_last_)
      return;
    has_last_ = false;
    ways_[count_++] = last_;
    std::push_heap(ways_.begin(), end(), is_shorter);
    if (count_ > most) {
      std::pop_heap(ways_.begin(), end(), is_shorter);
      --count_;
    }
  }
  std::array<WayOver, most + 1> ways_; // a heap, the longest first
  WayOver last_;                       // not in the heap yet
  bool has_last_ = false;
  std::size_t count_ = 0;
  double squared_beside_ = 0; // m2
};

/// What a thread has found out about the eyes that it looked from last.
class EyeMemory {
 public:
  struct Entry {
    Vector3 at = Vector3::Constant(std::numeric_limits<double>::quiet_NaN());
    std::uint64_t incision = 0;
    Blockers before, before_lifted;
  };
  ShortestWays ways; // of the detour that is looked for
  /// Of an eye on an incision by its number; empty where the eye is new.
  Entry& of(const Vector3& at, std::uint64_t incision) {
    std::uint64_t hash = incision;
    for (int axis = 0; axis < 3; ++axis)
      hash = (hash ^ std::bit_cast<std::uint64_t>(at[axis])) * 0x9E3779B97F4A7C15ULL;
    Entry& entry = entries_[hash >> 52U];
    if (entry.incision != incision || entry.at != at)
      entry = {at, incision, {}, {}};
    return entry;
  }

 private:
  std::array<Entry, 4096> entries_;
};

EyeMemory& eye_memory_of_this_thread() {
  thread_local const std::unique_ptr<EyeMemory> memory = std::make_unique<EyeMemory>();
  return *memory;
}

thread_local std::uint64_t lines_walked = 0;

std::uint64_t next_incision_number() {
  static std::atomic<std::uint64_t> last{0};
  return ++last;
}

} // namespace

struct Incision::Data {
  Data(std::vector<SurfaceMesh> sheets_in, std::shared_ptr<const Domain> domain_in, int revision_in,
       std::vector<SurfaceMesh> walls_in)
      : sheets(std::move(sheets_in)), cut_sheets(static_cast<int>(sheets.size())), domain(std::move(domain_in)),
        revision(revision_in) {
    if (!domain)
      throw InputError("an incision needs a body, none is given");
    for (int s = 0; s < std::ssize(sheets); ++s) {
      const std::string name = fmt::format("sheet {} of the incision", s);
      check_sheet(sheets[s], name);
      if (!reaches_inside(sheets[s], *domain))
        throw InputError(fmt::format("{} lies outside the body: no point of its {} triangles is inside", name,
                                     sheets[s].triangles.size()));
    }
    std::move(walls_in.begin(), walls_in.end(), std::back_inserter(sheets));
    build_triangles();
    build_front();
  }

  void build_triangles() {
    const double size = domain->bounds().extent().norm();
    flat = 1e-12 * size;
    std::vector<SheetTriangle> in_sheets;
    std::vector<std::array<Vector3, 3>> of_triangles;
    for (int s = 0; s < std::ssize(sheets); ++s)
      for (int t = 0; t < std::ssize(sheets[s].triangles); ++t) {
        in_sheets.push_back({s, t});
        of_triangles.push_back(corners_of(s, t));
      }
    tree = BoxTree(of_triangles, abutting * size);
    std::vector<Neighbours> neighbours;
    std::vector<std::vector<bool>> at_border;
    for (const SurfaceMesh& sheet : sheets) {
      neighbours.push_back(triangle_neighbours(sheet));
      std::vector<bool>& border = at_border.emplace_back(sheet.vertices.size(), false);
      for (int t = 0; t < std::ssize(sheet.triangles); ++t)
        for (int e = 0; e < 3; ++e)
          if (neighbours.back()[t][e] < 0)
            border[sheet.triangles[t][e]] = border[sheet.triangles[t][(e + 1) % 3]] = true;
    }
    pieces = find_front(sheets, neighbours, in_sheets, tree, *domain);
    triangles.reserve(in_sheets.size());
    corners.reserve(in_sheets.size());
    walls.reserve(in_sheets.size());
    border_flags.reserve(in_sheets.size());
    for (const int i : tree.order()) {
      const auto [s, t] = in_sheets[i];
      triangles.push_back(in_sheets[i]);
      corners.push_back(corners_of(s, t));
      const auto& [a, b, c] = corners.back();
      walls.emplace_back(a - tree.origin(), b - tree.origin(), c - tree.origin());
      BorderFlags& flags = border_flags.emplace_back();
      for (int e = 0; e < 3; ++e) {
        flags[e] = neighbours[s][t][e] < 0;
        flags[3 + e] = at_border[s][sheets[s].triangles[t][e]];
      }
    }
  }

  void build_front() {
    std::vector<BoundingBox> boxes;
    for (const FrontPiece& piece : pieces) {
      const auto& [from, to, sheet] = piece.segment;
      front.push_back(piece.segment);
      const double length = (to - from).norm();
      front_lines.push_back({(to - from) / length, length});
      front_length += length;
      boxes.push_back({from.cwiseMin(to), from.cwiseMax(to)});
    }
    front_tree = BoxTree(boxes);
  }

  [[nodiscard]] std::array<Vector3, 3> corners_of(int sheet, int triangle) const {
    const SurfaceMesh& mesh = sheets[sheet];
    const Triangle& t = mesh.triangles[triangle];
    return {mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
  }

  /// What blocks(a, b) says where no known triangle does; the one that does is known then.
  [[nodiscard]] bool blocks_anew(const Vector3& a, const Vector3& b, Blockers& known) const {
    ++lines_walked;
    const Vector3 p = a - tree.origin(), q = b - tree.origin();
    return tree.any_on_segment(a, b, [&](int place) {
      if (!walls[place].meets(p, q, flat))
        return false;
      known.add(place);
      return true;
    });
  }
  /// Whether a known triangle blocks the sight line from a to b.
  [[nodiscard]] bool is_known_to_block(const Vector3& a, const Vector3& b, Blockers& known) const {
    const Vector3 p = a - tree.origin(), q = b - tree.origin();
    for (int k = 0; k < known.count; ++k)
      if (walls[known.walls[k]].meets(p, q, flat)) {
        known.come_first(k);
        return true;
      }
    return false;
  }

  /// Sets the directions of a frame at `share` of its segment.
  void turn_to(double share, FrontFrame& frame) const {
    const auto& [segment, from, to] = pieces[frame.segment];
    frame.normal = ((1 - share) * from.normal + share * to.normal).normalized();
    const Vector3 ahead = (1 - share) * from.ahead + share * to.ahead;
    frame.ahead = (ahead - ahead.dot(frame.normal) * frame.normal).normalized();
    frame.tangent = frame.normal.cross(frame.ahead);
  }

  // Order as in TriangleFeature after `face`: edges ab, bc, ca, corners a, b, c.
  using BorderFlags = std::array<bool, 6>;

  std::vector<SurfaceMesh> sheets;
  int cut_sheets;
  std::shared_ptr<const Domain> domain;
  int revision;
  std::uint64_t number = next_incision_number(); // of this object, none other has it
  double flat = 0;                               // m, height within which a point lies on a triangle
  BoxTree tree;                                  // of all triangles; the next four in its order
  std::vector<SheetTriangle> triangles;
  std::vector<std::array<Vector3, 3>> corners;
  std::vector<Wall> walls;
  std::vector<BorderFlags> border_flags;
  std::vector<FrontPiece> pieces;
  std::vector<FrontSegment> front;
  struct Line {
    Vector3 direction; // unit
    double length;     // m
  };
  std::vector<Line> front_lines; // of the segments
  BoxTree front_tree;
  double front_length = 0; // m
  mutable std::once_flag area_known;
  mutable double area = 0; // m2
};

std::uint64_t sight_lines_walked() {
  return lines_walked;
}

Incision::Incision(std::vector<SurfaceMesh> sheets, std::shared_ptr<const Domain> domain, int revision,
                   std::vector<SurfaceMesh> walls)
    : data_(std::make_unique<const Data>(std::move(sheets), std::move(domain), revision, std::move(walls))) {}
Incision::~Incision() = default;

const std::vector<SurfaceMesh>& Incision::sheets() const {
  return data_->sheets;
}
int Incision::cut_sheets() const {
  return data_->cut_sheets;
}
const std::shared_ptr<const Domain>& Incision::domain() const {
  return data_->domain;
}
int Incision::revision() const {
  return data_->revision;
}
const std::vector<FrontSegment>& Incision::front() const {
  return data_->front;
}
double Incision::front_length() const {
  return data_->front_length;
}

double Incision::area() const {
  std::call_once(data_->area_known, [this] {
    for (int s = 0; s < data_->cut_sheets; ++s)
      data_->area += area_inside(data_->sheets[s], *data_->domain);
  });
  return data_->area;
}

bool Incision::blocks(const Vector3& a, const Vector3& b) const {
  Blockers& known = eye_memory_of_this_thread().of(a, data_->number).before;
  return data_->is_known_to_block(a, b, known) || data_->blocks_anew(a, b, known);
}

bool Incision::walls_between(const Vector3& centre, const Vector3& half, const Vector3& y, std::size_t most,
                             std::vector<int>& walls) const {
  const Data& data = *data_;
  const Vector3 from = centre - data.tree.origin(), to = y - data.tree.origin();
  walls.clear();
  return !data.tree.any_between(centre, half, y, [&](int place) {
    if (data.walls[place].is_beside(from, half, to, data.flat))
      return false;
    if (walls.size() == most)
      return true;
    walls.push_back(place);
    return false;
  });
}

std::pair<int, int> Incision::triangle_of(int wall) const {
  return {data_->triangles[wall].sheet, data_->triangles[wall].triangle};
}

bool Incision::blocks(const Vector3& a, const Vector3& b, std::span<int> walls) const {
  const Data& data = *data_;
  const Vector3 p = a - data.tree.origin(), q = b - data.tree.origin();
  for (int& place : walls)
    if (data.walls[place].meets(p, q, data.flat)) {
      std::swap(place, walls.front()); // mostly it blocks the next segment, too
      return true;
    }
  return false;
}

bool Incision::blocks(const Vector3& a, const Vector3& b, int& wall) const {
  if (wall >= 0 && data_->walls[wall].meets(a - data_->tree.origin(), b - data_->tree.origin(), data_->flat))
    return true;
  Blockers& known = eye_memory_of_this_thread().of(b, data_->number).before;
  const bool is_blocked = data_->is_known_to_block(a, b, known) || data_->blocks_anew(a, b, known);
  if (is_blocked)
    wall = known.walls.front();
  return is_blocked;
}

bool Incision::near(const Vector3& x, double radius) const {
  return data_->tree.any_within(x, radius);
}

std::optional<SheetPoint> Incision::closest(const Vector3& x, double reach) const {
  return closest_where(x, reach, any_sheet);
}

std::optional<SheetPoint> Incision::closest_of(int sheet, const Vector3& x, double reach) const {
  return closest_where(x, reach, sheet);
}

std::optional<SheetPoint> Incision::closest_where(const Vector3& x, double reach, int sheet) const {
  const Data& data = *data_;
  SheetPoint nearest;
  int nearest_place = -1;
  double head_on = 0; // height of x over the plane of the nearest triangle, m
  TriangleFeature feature = TriangleFeature::face;
  const Eigen::Vector3f at = single(x - data.tree.origin());
  // Among triangles that share the nearest edge or vertex the one that x is highest above tells the side.
  constexpr double tie = 1e-12;
  const double squared = data.tree.least(
      std::nextafter(reach * reach, std::numeric_limits<double>::infinity()),
      [&](const BoxTree::Boxes& boxes) { return boxes.squared_distance(at); },
      [&](int place, double best) {
        if (sheet != any_sheet && data.triangles[place].sheet != sheet)
          return best;
        const auto& [a, b, c] = data.corners[place];
        const TrianglePoint candidate = closest_on_triangle(x, a, b, c);
        const double candidate_squared = (x - candidate.point).squaredNorm();
        const double height = std::abs(data.walls[place].normal.dot(x - a));
        const bool tied = nearest_place >= 0 && std::abs(candidate_squared - best) <= tie * best;
        if (tied ? height <= head_on : candidate_squared >= best)
          return best;
        nearest_place = place;
        nearest.point = candidate.point;
        feature = candidate.feature;
        head_on = height;
        return std::min(candidate_squared, best);
      });
  if (nearest_place < 0)
    return std::nullopt;
  nearest.normal = data.walls[nearest_place].normal;
  nearest.distance = std::sqrt(squared);
  nearest.sheet = data.triangles[nearest_place].sheet;
  nearest.triangle = data.triangles[nearest_place].triangle;
  nearest.on_border =
      feature != TriangleFeature::face && data.border_flags[nearest_place][static_cast<std::size_t>(feature) - 1];
  return nearest;
}

std::optional<FrontFrame> Incision::front_frame(const Vector3& x, double reach) const {
  return front_frame_where(x, reach, nullptr);
}

std::optional<FrontFrame> Incision::front_frame_among(const std::vector<char>& marked, const Vector3& x,
                                                      double reach) const {
  return front_frame_where(x, reach, &marked);
}

std::optional<FrontFrame> Incision::front_frame_where(const Vector3& x, double reach,
                                                      const std::vector<char>* marked) const {
  const Data& data = *data_;
  FrontFrame frame;
  double share = 0; // place on the segment, 0 to 1
  const Eigen::Vector3f at = single(x - data.front_tree.origin());
  const double squared = data.front_tree.least(
      std::nextafter(reach * reach, std::numeric_limits<double>::infinity()),
      [&](const BoxTree::Boxes& boxes) { return boxes.squared_distance(at); },
      [&](int place, double best) {
        const int segment = data.front_tree.order()[place];
        if (marked != nullptr && (*marked)[segment] == 0)
          return best;
        const auto& [from, to, sheet] = data.front[segment];
        const double s = std::clamp((x - from).dot(to - from) / (to - from).squaredNorm(), 0.0, 1.0);
        const Vector3 point = from + s * (to - from);
        const double candidate = (x - point).squaredNorm();
        if (candidate > best ||
            (candidate == best && !(frame.segment >= 0 && before(data.front[segment], data.front[frame.segment]))))
          return best;
        frame.segment = segment;
        frame.point = point;
        share = s;
        return candidate;
      });
  if (frame.segment < 0)
    return std::nullopt;
  const FrontPiece& piece = data.pieces[frame.segment];
  frame.distance = std::sqrt(squared);
  data.turn_to(share, frame);
  // Around a corner of the sheet the way ahead turns with x, from that of one side to that of the other.
  if ((share == 0 && piece.from.corner) || (share == 1 && piece.to.corner)) {
    const Vector3 away = x - frame.point, in_plane = away - away.dot(frame.normal) * frame.normal;
    if (in_plane.norm() > 1e-6 * frame.distance) {
      frame.ahead = in_plane.normalized();
      frame.tangent = frame.normal.cross(frame.ahead);
    }
  }
  return frame;
}

FrontFrame Incision::front_frame_at(int segment, double share) const {
  const auto& [from, to, sheet] = data_->front.at(segment);
  FrontFrame frame;
  frame.segment = segment;
  frame.point = from + share * (to - from);
  frame.distance = 0;
  data_->turn_to(share, frame);
  return frame;
}

bool Incision::hides(const Eye& x, const Eye& y) const {
  Blockers& known = eye_memory_of_this_thread().of(x.at, data_->number).before;
  return (data_->is_known_to_block(x.at, y.at, known) || data_->blocks_anew(x.at, y.at, known)) && hides_blocked(x, y);
}

bool Incision::hides_blocked(const Eye& x, const Eye& y) const {
  // Only points at a face can be hidden by its bulge.
  if (!x.on_face() && !y.on_face())
    return true;
  Blockers& known = eye_memory_of_this_thread().of(x.at, data_->number).before_lifted;
  return data_->is_known_to_block(x.lifted, y.lifted, known) || data_->blocks_anew(x.lifted, y.lifted, known);
}

/// Ways between two eyes over the front, no longer than `reach` m.
struct Incision::DetourSearch {
  // A cut made in small steps is rough: from a point on its face the front hides behind bumps much lower than the
  // sheet is wide. Lifted off the face it looks at a place a little ahead of the front, where both sides meet; by so
  // little that no leg leaves the ellipsoid of the ways up to `reach` by more than the eyes are lifted.
  static constexpr double most_ahead = 0.15;
  // A line to the front ends a thousandth of the way before it, where the border itself is.
  static constexpr double pulled_in = 1e-3;
  // Of `reach`. A way so near to one that is blocked is not looked at: a sphere that is large beside the segments of
  // the front has hundreds of them.
  static constexpr double beside = 0.03;

  struct Line {
    const Eye& eye;
    EyeMemory::Entry& known;
    Vector3 to, lifted_to;
    bool is_blocked, is_lifted_blocked; // by a known triangle
  };

  DetourSearch(const Data& of, const Eye& from, const Eye& to, double longest)
      : data(of), x(from), y(to), reach(longest), at_x(single(x.at - data.front_tree.origin())),
        at_y(single(y.at - data.front_tree.origin())), of_x(eye_memory_of_this_thread().of(x.at, data.number)),
        of_y(eye_memory_of_this_thread().of(y.at, data.number)) {}

  [[nodiscard]] Line line_from(const Eye& eye, EyeMemory::Entry& known, const Vector3& over,
                               const Vector3& ahead) const {
    Line line{eye, known, over + pulled_in * (eye.at - over), over + ahead, false, true};
    line.is_blocked = data.is_known_to_block(eye.at, line.to, known.before);
    if (line.is_blocked && eye.on_face())
      line.is_lifted_blocked = data.is_known_to_block(eye.lifted, line.lifted_to, known.before_lifted);
    return line;
  }

  [[nodiscard]] bool is_free(const Line& way) const {
    if (!way.is_blocked && !data.blocks_anew(way.eye.at, way.to, way.known.before))
      return true;
    if (!way.eye.on_face())
      return false;
    if (way.is_blocked)
      return !way.is_lifted_blocked && !data.blocks_anew(way.eye.lifted, way.lifted_to, way.known.before_lifted);
    return !data.is_known_to_block(way.eye.lifted, way.lifted_to, way.known.before_lifted) &&
           !data.blocks_anew(way.eye.lifted, way.lifted_to, way.known.before_lifted);
  }

  bool is_clear(const WayOver& way) {
    // Of two eyes at one place in the memory the second has lists of its own.
    EyeMemory::Entry& known_x = &of_x == &of_y ? own_x : of_x;
    const FrontPiece& piece = data.pieces[way.segment];
    const Vector3 ahead = std::min(most_ahead * reach, 0.5 * (reach - way.length)) *
                          ((1 - way.share) * piece.from.ahead + way.share * piece.to.ahead);
    const Line from_x = line_from(x, known_x, way.over, ahead);
    if (from_x.is_blocked && from_x.is_lifted_blocked)
      return false;
    const Line from_y = line_from(y, of_y, way.over, ahead);
    return !(from_y.is_blocked && from_y.is_lifted_blocked) && is_free(from_x) && is_free(from_y);
  }

  /// The shortest way over a segment, where it is shorter than `most` m.
  [[nodiscard]] std::optional<WayOver> way_over(int segment, double most) const {
    const auto& [from, to, sheet] = data.front[segment];
    // Unfolded about the segment's line x and y lie on either side of it; the way crosses it on a straight line.
    const auto& [direction, length] = data.front_lines[segment];
    const Vector3 to_x = x.at - from, to_y = y.at - from;
    const double along_x = direction.dot(to_x), along_y = direction.dot(to_y);
    const double off_x = (to_x - along_x * direction).norm(), off_y = (to_y - along_y * direction).norm();
    // No way over the whole line is shorter than that.
    const double sum = off_x + off_y, shift = along_x - along_y;
    if ((sum * sum + shift * shift) * (1 - 1e-12) > most * most)
      return std::nullopt;
    const double crossing = off_x + off_y > 0 ? (along_x * off_y + along_y * off_x) / (off_x + off_y) : along_x;
    const double share = std::clamp(crossing / length, 0.0, 1.0);
    const Vector3 over = from + share * (to - from);
    const double way = (x.at - over).norm() + (over - y.at).norm();
    return way < most ? std::optional(WayOver{way, share, segment, over}) : std::nullopt;
  }

  /// Calls visit(segment, most) for segments over which a way may be shorter than `most` m, which it returns for the
  /// next ones.
  template <class Visit>
  void for_segments(double most, const Visit& visit) const {
    static_cast<void>(data.front_tree.least(
        most,
        [&](const BoxTree::Boxes& boxes) -> BoxTree::Four {
          return boxes.squared_distance(at_x).sqrt() + boxes.squared_distance(at_y).sqrt();
        },
        [&](int place, double best) { return visit(data.front_tree.order()[place], best); }));
  }

  const Data& data;
  const Eye &x, &y;
  double reach;
  Eigen::Vector3f at_x, at_y;
  EyeMemory::Entry &of_x, &of_y;
  EyeMemory::Entry own_x{};
};

std::optional<Detour> Incision::detour(const Eye& x, const Eye& y, double reach, int first) const {
  DetourSearch search(*data_, x, y, reach);
  const double beyond = std::nextafter(reach, std::numeric_limits<double>::infinity());
  // Mostly the shortest way of all is clear: then no other need be looked at.
  std::optional<WayOver> any;
  const auto keep_shortest = [&](int segment, double best) {
    const std::optional<WayOver> way = search.way_over(segment, best);
    any = way ? way : any;
    return way ? way->length : best;
  };
  search.for_segments(first >= 0 ? keep_shortest(first, beyond) : beyond, keep_shortest);
  if (!any)
    return std::nullopt;
  if (search.is_clear(*any))
    return Detour{any->length, any->over};
  ShortestWays& ways = eye_memory_of_this_thread().ways;
  ways.clear(DetourSearch::beside * reach);
  search.for_segments(beyond, [&](int segment, double best) {
    if (const std::optional<WayOver> way = search.way_over(segment, best))
      ways.add(*way);
    return ways.limit(best);
  });
  const std::span<WayOver> in_order = ways.in_order();
  std::size_t blocked = 0; // these come first
  for (const WayOver& way : in_order) {
    if (std::any_of(in_order.begin(), in_order.begin() + static_cast<std::ptrdiff_t>(blocked),
                    [&](const WayOver& other) { return ways.are_beside(way, other); }))
      continue;
    if (search.is_clear(way))
      return Detour{way.length, way.over};
    in_order[blocked++] = way;
  }
  return std::nullopt;
}

} // namespace spherecut::topology
