#include "topology/blade.hpp"

#include "topology/errors.hpp"
#include "topology/sheet_front.hpp"
#include "topology/swept_sheets.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <optional>
#include <unordered_map>
#include <utility>

namespace spherecut::topology {

namespace {

/// Where one piece of the edge leads a sheet.
struct Lead {
  int sheet = -1;                   // -1: none
  int left = -1, right = -1;        // vertices of the sheet
  Vector3 normal = Vector3::Zero(); // unit, of the last strip there
};

/// What one piece of the edge does between two rows.
struct Stroke {
  Vector3 normal = Vector3::Zero();
  bool swept = false; // has area
  bool turns = false; // sharply from the strip it would extend
  bool added = false;
};

/// Vertices and triangles to append to a sheet; vertices count on from those it has.
struct Strip {
  std::vector<Vector3> vertices;
  std::vector<Triangle> triangles;
  std::vector<std::array<Vector3, 3>> corners;
  std::vector<std::array<int, 2>> leads; // left and right vertex of each piece's new edge
};

struct Tally {
  bool swept = false, near_body = false;
};

std::vector<Vector3> resampled(const std::vector<Vector3>& edge, double longest) {
  std::vector<Vector3> points{edge.front()};
  for (std::size_t i = 1; i < edge.size(); ++i) {
    const int pieces = std::max(1, static_cast<int>(std::ceil((edge[i] - edge[i - 1]).norm() / longest - 1e-6)));
    for (int k = 1; k <= pieces; ++k)
      points.push_back(edge[i - 1] + double(k) / pieces * (edge[i] - edge[i - 1]));
  }
  return points;
}

/// Height of a triangle over its longest edge, by that edge: 0 flat, 0.87 equilateral.
double quality(const Vector3& a, const Vector3& b, const Vector3& c) {
  const double longest = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  return (b - a).cross(c - a).norm() / longest;
}

Vector3 nearest_on(const std::vector<Vector3>& polyline, const Vector3& x) {
  Vector3 nearest = polyline.front();
  for (std::size_t i = 1; i < polyline.size(); ++i) {
    const Vector3 along = polyline[i] - polyline[i - 1];
    const double s = std::clamp((x - polyline[i - 1]).dot(along) / along.squaredNorm(), 0.0, 1.0);
    const Vector3 candidate = polyline[i - 1] + s * along;
    if ((candidate - x).norm() < (nearest - x).norm())
      nearest = candidate;
  }
  return nearest;
}

/// The triangles of a sheet from `first` on, with their own vertices alone.
SurfaceMesh tail(const SurfaceMesh& sheet, int first) {
  SurfaceMesh patch;
  std::unordered_map<int, int> index;
  for (int t = first; t < std::ssize(sheet.triangles); ++t) {
    Triangle corners{};
    for (int c = 0; c < 3; ++c) {
      const int v = sheet.triangles[t][c];
      const auto [found, is_new] = index.emplace(v, static_cast<int>(patch.vertices.size()));
      if (is_new)
        patch.vertices.push_back(sheet.vertices[v]);
      corners[c] = found->second;
    }
    patch.triangles.push_back(corners);
  }
  return patch;
}

void check(const SweepOptions& options) {
  const auto require = [](bool good, const char* name, double value, const char* limit) {
    if (!good)
      throw InputError(fmt::format("blade sweep: {} = {}, must be {}", name, value, limit));
  };
  require(std::isfinite(options.edge) && options.edge > 0, "edge", options.edge, "a positive number of metres");
  require(options.minimum_step >= 0.001 && options.minimum_step <= 1, "minimum_step", options.minimum_step,
          "from 0.001 to 1");
  require(options.sharp_turn > 0 && options.sharp_turn <= 90, "sharp_turn", options.sharp_turn, "in (0, 90] degrees");
  require(options.most_triangles > 0, "most_triangles", options.most_triangles, "positive");
}

} // namespace

void check(const Blade& blade) {
  if (blade.edge.size() < 2)
    throw InputError(fmt::format("blade: its edge has {} points, at least 2 are needed", blade.edge.size()));
  for (std::size_t i = 0; i < blade.edge.size(); ++i) {
    const Vector3& x = blade.edge[i];
    if (!x.allFinite())
      throw InputError(fmt::format("blade: point {} of its edge ({}, {}, {}) is not finite", i, x.x(), x.y(), x.z()));
    if (i > 0 && (x - blade.edge[i - 1]).norm() < 1e-9)
      throw InputError(fmt::format("blade: points {} and {} of its edge coincide", i - 1, i));
  }
  if (!(std::isfinite(blade.edge_radius) && blade.edge_radius > 0))
    throw InputError(fmt::format("blade: edge radius = {} m, must be a positive number", blade.edge_radius));
}

struct BladeSweep::State {
  State(Blade blade_in, std::shared_ptr<const Domain> domain_in, const SweepOptions& options_in)
      : blade(std::move(blade_in)), domain(std::move(domain_in)), options(options_in),
        sheets(2 * options.edge, std::min(blade.edge_radius, 0.1 * options.edge)),
        edge(resampled(blade.edge, options.edge)), tiny(1e-4 * options.edge),
        cos_turn(std::cos(options.sharp_turn * M_PI / 180)) {}

  [[nodiscard]] std::vector<Vector3> row_at(const Vector3& position, const Eigen::Quaterniond& orientation,
                                            const RestMap& to_rest) const {
    std::vector<Vector3> points;
    points.reserve(edge.size());
    for (const Vector3& x : edge) {
      const Vector3 now = orientation * x + position;
      points.push_back(to_rest ? to_rest(now) : now);
      if (!points.back().allFinite())
        throw NumericalError(
            fmt::format("the map to the rest frame is not finite at ({}, {}, {})", now.x(), now.y(), now.z()));
    }
    return points;
  }

  /// Rows between the present one and the one at `pose`, no more than an edge apart; the last is that at `pose`.
  [[nodiscard]] std::vector<std::vector<Vector3>> rows_to(const BladePose& pose, const RestMap& to_rest) const {
    const std::vector<Vector3> last = row_at(pose.position, pose.orientation, to_rest);
    double farthest = 0;
    for (std::size_t i = 0; i < last.size(); ++i)
      farthest = std::max(farthest, (last[i] - row[i]).norm());
    if (farthest < options.minimum_step * options.edge)
      return {};
    const double turn = row_pose.orientation.angularDistance(pose.orientation);
    constexpr double widest_turn = 0.35; // rad a row
    const double steps = std::ceil(std::max(farthest / options.edge - 1e-6, turn / widest_turn));
    const double triangles = sheets.triangles() + 2 * steps * static_cast<double>(leads.size());
    if (!(triangles <= options.most_triangles))
      throw InputError(fmt::format("blade sweep: a motion of {} m could bring the cut to {:.0f} triangles, at most {} "
                                   "are allowed",
                                   farthest, triangles, options.most_triangles));
    // What the tissue moved since the present row was cut fades out on the way.
    std::vector<Vector3> lag = row_at(row_pose.position, row_pose.orientation, to_rest);
    for (std::size_t i = 0; i < lag.size(); ++i)
      lag[i] = row[i] - lag[i];
    std::vector<std::vector<Vector3>> rows;
    const int count = std::max(1, static_cast<int>(steps));
    for (int k = 1; k < count; ++k) {
      const double s = double(k) / count;
      rows.push_back(row_at((1 - s) * row_pose.position + s * pose.position,
                            row_pose.orientation.slerp(s, pose.orientation), to_rest));
      for (std::size_t i = 0; i < lag.size(); ++i)
        rows.back()[i] += (1 - s) * lag[i];
    }
    rows.push_back(last);
    return rows;
  }

  void measure(const std::vector<Vector3>& a, const std::vector<Vector3>& b, std::vector<Stroke>& strokes) const {
    for (std::size_t i = 0; i < strokes.size(); ++i) {
      const Vector3 area_vector = 0.5 * (b[i + 1] - a[i]).cross(b[i] - a[i + 1]);
      const double length = 0.5 * ((a[i + 1] - a[i]).norm() + (b[i + 1] - b[i]).norm());
      strokes[i].swept = area_vector.norm() > tiny * length;
      strokes[i].normal = strokes[i].swept ? Vector3(area_vector.normalized()) : Vector3::Zero();
      strokes[i].turns = leads[i].sheet >= 0 && strokes[i].normal.dot(leads[i].normal) < cos_turn;
    }
  }

  /// Lets the points of the edge that no sheet hangs on run along the sheets they lie on, up to where they leave them.
  void run_along_sheets(std::vector<Vector3>& a, const std::vector<Vector3>& b, const std::vector<Stroke>& strokes) {
    const auto extends = [&](std::size_t i) {
      return i < strokes.size() && strokes[i].swept && leads[i].sheet >= 0 && !strokes[i].turns;
    };
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (a[i] == b[i] || extends(i) || (i > 0 && extends(i - 1)) || !sheets.on_sheet(a[i]))
        continue;
      const auto at = [&](double s) { return Vector3(a[i] + s * (b[i] - a[i])); };
      constexpr int samples = 8;
      int k = 1;
      while (k <= samples && sheets.on_sheet(at(double(k) / samples)))
        ++k;
      Vector3 left_at = b[i];
      if (k <= samples) {
        double on = double(k - 1) / samples, off = double(k) / samples;
        for (int halving = 0; halving < 20; ++halving)
          (sheets.on_sheet(at(0.5 * (on + off))) ? on : off) = 0.5 * (on + off);
        left_at = sheets.on_sheet(at(on)).value_or(a[i]);
        if ((left_at - a[i]).norm() <= 3 * tiny || on * (b[i] - a[i]).norm() <= 2 * sheets.thickness())
          continue;
      }
      a[i] = left_at;
      if (i > 0)
        leads[i - 1] = {};
      if (i < leads.size())
        leads[i] = {};
    }
  }

  /// Whether the new edge of a strip lies on sheets that were there before.
  [[nodiscard]] bool cut_before(const Vector3& a_left, const Vector3& a_right, const Vector3& b_left,
                                const Vector3& b_right) const {
    return sheets.on_sheet(b_left) && sheets.on_sheet(b_right) && sheets.on_sheet(0.5 * (b_left + b_right)) &&
           sheets.on_sheet(0.25 * (a_left + a_right + b_left + b_right));
  }

  /// Triangles of pieces [first, last) that extend `sheet` (-1: a new one).
  [[nodiscard]] Strip strip(int sheet, std::size_t first, std::size_t last, const std::vector<Vector3>& a,
                            const std::vector<Vector3>& b) const {
    Strip result;
    const int base = sheet < 0 ? 0 : static_cast<int>(sheets.sheets()[sheet].vertices.size());
    const auto vertex = [&](const Vector3& x) {
      result.vertices.push_back(x);
      return base + static_cast<int>(result.vertices.size()) - 1;
    };
    const auto known = [&](std::size_t i) { return sheet >= 0 && leads[i].sheet == sheet; };
    const auto add = [&](const Triangle& t, const Vector3& p, const Vector3& q, const Vector3& r) {
      result.triangles.push_back(t);
      result.corners.push_back({p, q, r});
    };
    int a_right = -1, b_right = -1;
    for (std::size_t i = first; i < last; ++i) {
      const bool left_stays = a[i] == b[i], right_stays = a[i + 1] == b[i + 1];
      const int a_left = known(i) ? leads[i].left : i > first ? a_right : vertex(a[i]);
      const int b_left = i > first ? b_right : left_stays ? a_left : vertex(b[i]);
      a_right = known(i) ? leads[i].right : i + 1 < last && known(i + 1) ? leads[i + 1].left : vertex(a[i + 1]);
      b_right = right_stays ? a_right : vertex(b[i + 1]);
      if (left_stays)
        add({a_left, a_right, b_right}, a[i], a[i + 1], b[i + 1]);
      else if (right_stays)
        add({a_left, a_right, b_left}, a[i], a[i + 1], b[i]);
      else if (rising_diagonal(a, b, i)) {
        add({a_left, a_right, b_right}, a[i], a[i + 1], b[i + 1]);
        add({a_left, b_right, b_left}, a[i], b[i + 1], b[i]);
      } else {
        add({a_left, a_right, b_left}, a[i], a[i + 1], b[i]);
        add({a_right, b_right, b_left}, a[i + 1], b[i + 1], b[i]);
      }
      result.leads.push_back({b_left, b_right});
    }
    return result;
  }

  /// The better of the two diagonals of a piece's quadrangle, from the left of the old edge when they are as good.
  static bool rising_diagonal(const std::vector<Vector3>& a, const std::vector<Vector3>& b, std::size_t i) {
    const double rising = std::min(quality(a[i], a[i + 1], b[i + 1]), quality(a[i], b[i + 1], b[i]));
    const double falling = std::min(quality(a[i], a[i + 1], b[i]), quality(a[i + 1], b[i + 1], b[i]));
    return rising > falling * (1 - 1e-6);
  }

  static bool sound(const std::vector<Vector3>& a, const std::vector<Vector3>& b, std::size_t i) {
    constexpr double flattest = 1e-5;
    if (a[i] == b[i])
      return quality(a[i], a[i + 1], b[i + 1]) > flattest;
    if (a[i + 1] == b[i + 1])
      return quality(a[i], a[i + 1], b[i]) > flattest;
    return rising_diagonal(a, b, i)
               ? std::min(quality(a[i], a[i + 1], b[i + 1]), quality(a[i], b[i + 1], b[i])) > flattest
               : std::min(quality(a[i], a[i + 1], b[i]), quality(a[i + 1], b[i + 1], b[i])) > flattest;
  }

  /// Appends the strip of pieces [first, last) to `sheet`, or to a new one where it is -1 or would be crossed.
  void append(int sheet, std::size_t first, std::size_t last, const std::vector<Vector3>& a,
              const std::vector<Vector3>& b, const std::vector<Stroke>& strokes) {
    Strip added = strip(sheet, first, last, a, b);
    for (std::size_t t = 0; sheet >= 0 && t < added.triangles.size(); ++t)
      if (sheets.crosses(sheet, added.triangles[t], added.corners[t])) {
        sheet = -1;
        added = strip(sheet, first, last, a, b);
      }
    if (sheet < 0)
      sheet = sheets.add_sheet();
    for (const Vector3& x : added.vertices)
      sheets.add_vertex(sheet, x);
    for (const Triangle& t : added.triangles)
      sheets.add_triangle(sheet, t);
    for (std::size_t i = first; i < last; ++i)
      leads[i] = {sheet, added.leads[i - first][0], added.leads[i - first][1], strokes[i].normal};
  }

  /// Whether piece i + 1 may go on in the strip of piece i.
  [[nodiscard]] bool joined(std::size_t i, const std::vector<Vector3>& a, const std::vector<Vector3>& b,
                            const std::vector<Stroke>& strokes) const {
    return a[i + 1] != b[i + 1] && strokes[i].normal.dot(strokes[i + 1].normal) > cos_turn;
  }

  void advance(std::vector<Vector3> b, Tally& tally) {
    std::vector<Vector3> a = row;
    for (std::size_t i = 0; i < a.size(); ++i)
      if ((b[i] - a[i]).norm() <= tiny)
        b[i] = a[i];
    std::vector<Stroke> strokes(leads.size());
    measure(a, b, strokes);
    for (const Stroke& stroke : strokes)
      tally.swept = tally.swept || stroke.swept;
    run_along_sheets(a, b, strokes);
    for (std::size_t i = 0; i < a.size(); ++i)
      if ((b[i] - a[i]).norm() <= tiny)
        a[i] = b[i] = (a[i] == row[i] ? a[i] : b[i]);
    measure(a, b, strokes);

    std::vector<double> depth_a, depth_b;
    for (std::size_t i = 0; i < a.size(); ++i) {
      depth_a.push_back(domain->signed_distance(a[i]));
      depth_b.push_back(domain->signed_distance(b[i]));
    }
    std::vector<bool> wanted(strokes.size());
    for (std::size_t i = 0; i < strokes.size(); ++i) {
      const bool near_body = std::min({depth_a[i], depth_a[i + 1], depth_b[i], depth_b[i + 1]}) < options.edge;
      tally.near_body = tally.near_body || near_body;
      wanted[i] = strokes[i].swept && near_body && sound(a, b, i) && !cut_before(a[i], a[i + 1], b[i], b[i + 1]);
    }
    const std::vector<Lead> before = leads;
    for (std::size_t first = 0; first < strokes.size();) {
      std::size_t last = first + 1;
      if (wanted[first]) {
        const auto extends = [&](std::size_t i) { return before[i].sheet >= 0 && !strokes[i].turns; };
        const auto turns = [&](std::size_t i) { return before[i].sheet >= 0 && strokes[i].turns; };
        int sheet = extends(first) ? before[first].sheet : -1;
        bool is_new = turns(first);
        for (; last < strokes.size() && wanted[last] && joined(last - 1, a, b, strokes); ++last) {
          if (extends(last)) {
            const bool other_sheet = sheet >= 0 && sheet != before[last].sheet;
            const bool other_vertex = extends(last - 1) && before[last - 1].right != before[last].left;
            if (is_new || other_sheet || other_vertex)
              break;
            sheet = before[last].sheet;
          } else if (turns(last)) {
            if (sheet >= 0)
              break;
            is_new = true;
          }
        }
        append(is_new ? -1 : sheet, first, last, a, b, strokes);
        for (std::size_t i = first; i < last; ++i)
          strokes[i].added = true;
      }
      first = last;
    }
    for (std::size_t i = 0; i < strokes.size(); ++i)
      if (!strokes[i].added && (b[i] != row[i] || b[i + 1] != row[i + 1]))
        leads[i] = {};
    // Points that slid along the old edge stay on it, so that what they cut next leaves no film of tissue.
    for (std::size_t i = 0; i < b.size(); ++i) {
      const bool sweeps = (i > 0 && strokes[i - 1].swept) || (i < strokes.size() && strokes[i].swept);
      if (const Vector3 on_row = nearest_on(row, b[i]); !sweeps && (on_row - b[i]).norm() <= 2 * tiny)
        b[i] = on_row;
    }
    row = std::move(b);
  }

  SweepResult move(const BladePose& pose, const RestMap& to_rest) {
    SweepResult result;
    if (row.empty()) {
      row = row_at(pose.position, pose.orientation, to_rest);
      leads.assign(row.size() - 1, {});
      row_pose = pose;
      time = pose.time;
      result.refused = "the blade was only placed";
      return result;
    }
    const auto rows = rows_to(pose, to_rest);
    time = pose.time;
    if (rows.empty()) {
      result.refused = "the blade did not move";
      return result;
    }
    std::vector<int> had;
    for (const SurfaceMesh& sheet : sheets.sheets())
      had.push_back(static_cast<int>(sheet.triangles.size()));
    Tally tally;
    for (const std::vector<Vector3>& next : rows)
      advance(next, tally);
    row_pose = pose;
    had.resize(sheets.sheets().size(), 0);
    given.resize(had.size(), -1);
    for (int s = 0; s < std::ssize(had); ++s) {
      const SurfaceMesh& sheet = sheets.sheets()[s];
      const int count = static_cast<int>(sheet.triangles.size());
      if (count == had[s])
        continue;
      const SurfaceMesh patch = tail(sheet, had[s]);
      if (given[s] < 0 && !reaches_inside(patch, *domain))
        continue;
      const int first = given[s] < 0 ? 0 : had[s];
      if (given[s] < 0) {
        given[s] = static_cast<int>(order.size());
        order.push_back(s);
      }
      result.area += area_inside(patch, *domain);
      result.triangles += count - first;
      result.added.push_back({given[s], first, count - first});
    }
    if (result.triangles > 0)
      ++revision;
    else if (!tally.swept)
      result.refused = "the blade moved along its edge";
    else if (!tally.near_body)
      result.refused = "the blade moved outside the body";
    else
      result.refused = "the blade moved outside the body or where it had cut before";
    return result;
  }

  [[nodiscard]] std::vector<SurfaceMesh> given_sheets() const {
    std::vector<SurfaceMesh> result;
    for (const int s : order)
      result.push_back(sheets.sheets()[s]);
    return result;
  }

  Blade blade;
  std::shared_ptr<const Domain> domain;
  SweepOptions options;
  SweptSheets sheets;
  std::vector<Vector3> edge; // resampled, blade's frame
  double tiny;               // m: less motion, less height than this is none
  double cos_turn;
  std::vector<Vector3> row; // the edge in the rest frame where it last cut or was placed
  std::vector<Lead> leads;  // of the pieces of the row
  BladePose row_pose;
  std::optional<double> time;    // s, of the last pose
  std::vector<int> given, order; // place of each sheet among those given, -1 outside the body; and back
  int revision = 0;
  mutable std::shared_ptr<const Incision> incision;
};

BladeSweep::BladeSweep(Blade blade, std::shared_ptr<const Domain> domain, const SweepOptions& options) {
  topology::check(blade);
  check(options);
  if (!domain)
    throw InputError("blade sweep: there is no body to cut");
  state_ = std::make_unique<State>(std::move(blade), std::move(domain), options);
}
BladeSweep::~BladeSweep() = default;
BladeSweep::BladeSweep(const BladeSweep& other) : state_(std::make_unique<State>(*other.state_)) {}
BladeSweep& BladeSweep::operator=(const BladeSweep& other) {
  state_ = std::make_unique<State>(*other.state_);
  return *this;
}
BladeSweep::BladeSweep(BladeSweep&&) noexcept = default;
BladeSweep& BladeSweep::operator=(BladeSweep&&) noexcept = default;

SweepResult BladeSweep::move_to(const BladePose& pose, const RestMap& to_rest) {
  if (!pose.position.allFinite() || !pose.orientation.coeffs().allFinite() || !std::isfinite(pose.time))
    throw InputError(fmt::format("blade pose at time {} s: position ({}, {}, {}) or orientation is not finite",
                                 pose.time, pose.position.x(), pose.position.y(), pose.position.z()));
  if (!(pose.orientation.norm() > 1e-9))
    throw InputError(fmt::format("blade pose at time {} s: its orientation is zero", pose.time));
  if (state_->time && pose.time <= *state_->time)
    throw InputError(
        fmt::format("blade pose at time {} s does not come after the one at {} s", pose.time, *state_->time));
  BladePose unit = pose;
  unit.orientation.normalize();
  return state_->move(unit, to_rest);
}

void BladeSweep::lift() {
  state_->row.clear();
  state_->leads.clear();
}

void BladeSweep::extend(int sheet, const SurfaceMesh& grown) {
  State& state = *state_;
  if (sheet < 0 || sheet >= std::ssize(state.order))
    throw InputError(fmt::format("blade sweep: sheet {} does not exist; there are {}", sheet, state.order.size()));
  const int own = state.order[static_cast<std::size_t>(sheet)];
  const SurfaceMesh& now = state.sheets.sheets()[static_cast<std::size_t>(own)];
  const std::size_t vertices = now.vertices.size(), triangles = now.triangles.size();
  if (grown.vertices.size() < vertices || grown.triangles.size() < triangles)
    throw InputError(fmt::format("blade sweep: sheet {} of {} triangles cannot become one of {}", sheet, triangles,
                                 grown.triangles.size()));
  for (std::size_t v = vertices; v < grown.vertices.size(); ++v)
    state.sheets.add_vertex(own, grown.vertices[v]);
  for (std::size_t t = triangles; t < grown.triangles.size(); ++t)
    state.sheets.add_triangle(own, grown.triangles[t]);
  state.leads.assign(state.leads.size(), {});
  ++state.revision;
}

std::vector<SurfaceMesh> BladeSweep::sheets() const {
  return state_->given_sheets();
}
int BladeSweep::revision() const {
  return state_->revision;
}
std::shared_ptr<const Incision> BladeSweep::incision() const {
  if (!state_->incision || state_->incision->revision() != state_->revision)
    state_->incision = std::make_shared<const Incision>(state_->given_sheets(), state_->domain, state_->revision);
  return state_->incision;
}
const Blade& BladeSweep::blade() const {
  return state_->blade;
}
const std::vector<Vector3>& BladeSweep::edge_at_rest() const {
  return state_->row;
}

} // namespace spherecut::topology
