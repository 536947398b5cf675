#include "solvers/appended/front_functions.hpp"

#include "topology/search/point_tree.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

namespace spherecut::solvers {

namespace {

constexpr double least_run = 1e-9;  // of a spacing
constexpr double same_place = 1e-6; // of a segment

/// A run with the way along it in spacings.
struct MeasuredRun : FrontRun {
  std::vector<double> measure; // at the start of every segment, and at the end of the last
  bool reversed = false;       // measured from its end
  [[nodiscard]] double length() const { return measure.back(); }
};

/// Place of the vertex nearest to x in the order in which the vertices of a sheet came.
std::ptrdiff_t age_of(const topology::SurfaceMesh& sheet, const Vector3& x) {
  return std::min_element(
             sheet.vertices.begin(), sheet.vertices.end(),
             [&](const Vector3& a, const Vector3& b) { return (a - x).squaredNorm() < (b - x).squaredNorm(); }) -
         sheet.vertices.begin();
}

using PointKey = std::array<double, 3>;
PointKey key_of(const Vector3& x) {
  return {x.x(), x.y(), x.z()};
}

} // namespace

namespace {

/// The segment of the same sheet that goes on where each one ends, to rounding; -1: none does.
std::vector<int> next_segments(const std::vector<topology::FrontSegment>& front) {
  std::map<std::pair<int, PointKey>, int> starting;
  for (int s = 0; s < std::ssize(front); ++s)
    starting[{front[s].sheet, key_of(front[s].from)}] = s;
  std::vector<int> next(front.size(), -1);
  std::vector<char> follows(front.size(), 0);
  for (int s = 0; s < std::ssize(front); ++s)
    if (const auto found = starting.find({front[s].sheet, key_of(front[s].to)}); found != starting.end()) {
      next[s] = found->second;
      follows[found->second] = 1;
    }
  // Ends of pieces of one edge of the sheet may differ by rounding.
  for (int s = 0; s < std::ssize(front); ++s)
    for (int t = 0; t < std::ssize(front) && next[s] < 0; ++t)
      if (t != s && follows[t] == 0 && front[t].sheet == front[s].sheet &&
          (front[t].from - front[s].to).norm() <= same_place * (front[s].to - front[s].from).norm()) {
        next[s] = t;
        follows[t] = 1;
      }
  return next;
}

std::vector<FrontRun> runs_of(const topology::Incision& incision) {
  const std::vector<topology::FrontSegment>& front = incision.front();
  const std::vector<int> next = next_segments(front);
  std::vector<char> follows(front.size(), 0);
  for (const int s : next)
    if (s >= 0)
      follows[s] = 1;
  std::vector<char> taken(front.size(), 0);
  std::vector<FrontRun> runs;
  const auto follow = [&](int first) {
    FrontRun run;
    for (int s = first; taken[s] == 0;) {
      taken[s] = 1;
      run.segments.push_back(s);
      if (next[s] < 0)
        break;
      run.closed = next[s] == first;
      s = next[s];
    }
    runs.push_back(std::move(run));
  };
  for (int s = 0; s < std::ssize(front); ++s) // open runs first, from their starts
    if (taken[s] == 0 && follows[s] == 0)
      follow(s);
  for (int s = 0; s < std::ssize(front); ++s)
    if (taken[s] == 0)
      follow(s);
  return runs;
}

// `frame`: of the nearest point of the front that counts.
std::optional<FrontPlace> place_from(const topology::Incision& incision, const Vector3& x,
                                     const std::optional<topology::FrontFrame>& frame) {
  if (!frame)
    return std::nullopt;
  FrontPlace place;
  place.distance = frame->distance;
  place.segment = frame->segment;
  place.nearest = frame->point;
  const Vector3 d = x - frame->point;
  Vector3 normal = frame->normal;
  double behind = 1;
  const int own = incision.front()[frame->segment].sheet;
  if (frame->distance > 0)
    if (const auto sheet = incision.closest_of(own, x, frame->distance * (1 + 1e-9)); sheet && !sheet->on_border) {
      normal = sheet->normal;
      place.above = normal.dot(x - sheet->point);
      behind = -1;
    }
  if (behind > 0)
    place.above = normal.dot(d);
  const Vector3 along = d - place.above * normal;
  const double length = std::sqrt(std::max(0.0, frame->distance * frame->distance - place.above * place.above));
  place.ahead = behind * length;
  place.grad_above = normal;
  place.grad_ahead =
      along.norm() > 1e-9 * frame->distance && length > 0 ? Vector3(behind * along.normalized()) : frame->ahead;
  return place;
}

} // namespace

FrontRuns::FrontRuns(std::shared_ptr<const topology::Incision> incision)
    : incision_(std::move(incision)), runs_(runs_of(*incision_)), run_of_(incision_->front().size(), -1) {
  for (int r = 0; r < count(); ++r) {
    std::vector<char>& marked = marked_.emplace_back(incision_->front().size(), 0);
    BoundingBox& box = boxes_.emplace_back(BoundingBox{Vector3::Constant(std::numeric_limits<double>::infinity()),
                                                       Vector3::Constant(-std::numeric_limits<double>::infinity())});
    lengths_.push_back(0);
    for (const int s : runs_[r].segments) {
      run_of_[s] = r;
      marked[s] = 1;
      const topology::FrontSegment& segment = incision_->front()[s];
      lengths_.back() += (segment.to - segment.from).norm();
      box.lower = box.lower.cwiseMin(segment.from).cwiseMin(segment.to);
      box.upper = box.upper.cwiseMax(segment.from).cwiseMax(segment.to);
    }
  }
}

std::optional<FrontPlace> FrontRuns::place(int run, const Vector3& x, double reach) const {
  if (count() == 1)
    return front_place(*incision_, x, reach);
  const BoundingBox& box = boxes_[run];
  if ((x - x.cwiseMax(box.lower).cwiseMin(box.upper)).squaredNorm() > reach * reach)
    return std::nullopt;
  return place_from(*incision_, x, incision_->front_frame_among(marked_[run], x, reach));
}

std::optional<FrontPlace> front_place(const topology::Incision& incision, const Vector3& x, double reach) {
  return place_from(incision, x, incision.front_frame(x, reach));
}

namespace {

/// Stations along the runs of a front, and the nodes about it in their hats.
class FrontStations {
 public:
  FrontStations(const FrontRuns& runs, const NodeCloud& nodes, const FrontOptions& options)
      : of_front_(runs), incision_(runs.incision()), front_(incision_.front()), nodes_(nodes), options_(options),
        tree_(nodes.positions), place_in_run_(front_.size(), 0) {
    for (const FrontRun& run : runs.runs())
      runs_.push_back({run, {}, false});
    for (int r = 0; r < std::ssize(runs_); ++r)
      measure(r);
    of_run_.resize(runs_.size());
    for (int r = 0; r < std::ssize(runs_); ++r)
      put_stations(r);
  }

  [[nodiscard]] std::vector<FrontGroup> groups() const {
    std::vector<FrontGroup> groups;
    double widest = 0;
    for (int r = 0; r < std::ssize(runs_); ++r)
      for (std::size_t k = 0; k < of_run_[r].at.size(); ++k) {
        const FrontStation& station = all_[of_run_[r].first + k];
        widest = std::max(widest, station.spacing);
        for (int ring = 0; ring < options_.rings; ++ring)
          groups.push_back({station, r, ring, {}, {}});
      }
    for (int j = 0; j < nodes_.size(); ++j)
      add_node(j, widest, groups);
    std::erase_if(groups, [](const FrontGroup& group) { return group.nodes.empty(); });
    return groups;
  }

 private:
  struct Stations {
    std::vector<double> at; // spacings, along the run
    int first = 0;          // among all stations
  };

  [[nodiscard]] double spacing_at(const Vector3& x) const { return nodes_.spacings[tree_.nearest(x).index]; }

  void measure(int r) {
    MeasuredRun& run = runs_[r];
    run.measure.assign(1, 0);
    for (int k = 0; k < std::ssize(run.segments); ++k) {
      const topology::FrontSegment& segment = front_[run.segments[k]];
      place_in_run_[run.segments[k]] = k;
      run.measure.push_back(run.measure.back() +
                            (segment.to - segment.from).norm() / spacing_at(0.5 * (segment.from + segment.to)));
    }
    if (!run.closed) {
      // The older end, whose place in the sheet came first: it stays where it is as the other end grows.
      const topology::FrontSegment &first = front_[run.segments.front()], &last = front_[run.segments.back()];
      run.reversed =
          age_of(incision_.sheets()[last.sheet], last.to) < age_of(incision_.sheets()[first.sheet], first.from);
    }
  }

  /// An open run has a station at either end.
  void put_stations(int r) {
    const MeasuredRun& run = runs_[r];
    of_run_[r].first = static_cast<int>(all_.size());
    const double length = run.length();
    if (length < least_run)
      return;
    std::vector<double>& at = of_run_[r].at;
    if (run.closed) {
      const int count = std::max(3, static_cast<int>(std::lround(length / options_.gather)));
      for (int k = 0; k < count; ++k)
        at.push_back(length * k / count);
    } else {
      for (double s = 0; s < length - 0.5 * options_.gather; s += options_.gather)
        at.push_back(s);
      at.push_back(length);
    }
    for (const double measured : at) {
      const double s = run.reversed ? length - measured : measured;
      const auto next = std::upper_bound(run.measure.begin() + 1, run.measure.end() - 1, s);
      const auto k = static_cast<int>(next - run.measure.begin()) - 1;
      const double share = std::clamp((s - run.measure[k]) / (run.measure[k + 1] - run.measure[k]), 0.0, 1.0);
      const topology::FrontFrame frame = incision_.front_frame_at(run.segments[k], share);
      FrontStation station;
      station.point = frame.point;
      station.axes << frame.ahead, frame.normal, frame.tangent;
      station.spacing = spacing_at(frame.point);
      all_.push_back(station);
    }
  }

  /// Node j joins the groups of the nearest run in whose hats it lies.
  void add_node(int j, double widest, std::vector<FrontGroup>& groups) const {
    const auto place = front_place(incision_, nodes_.positions[j], options_.radius * widest);
    if (!place)
      return;
    const int r = of_front_.run_of(place->segment);
    const std::vector<double>& at = of_run_[r].at;
    if (at.empty())
      return;
    const double radius = options_.radius * spacing_at(place->nearest);
    if (place->distance > radius)
      return;
    const MeasuredRun& run = runs_[r];
    const topology::FrontSegment& segment = front_[place->segment];
    const int k = place_in_run_[place->segment];
    const double length = (segment.to - segment.from).norm();
    const double share = length > 0 ? std::clamp((place->nearest - segment.from).norm() / length, 0.0, 1.0) : 0;
    double s = run.measure[k] + share * (run.measure[k + 1] - run.measure[k]);
    if (run.reversed)
      s = run.length() - s;
    const int count = static_cast<int>(at.size());
    const int low = std::clamp(static_cast<int>(std::upper_bound(at.begin(), at.end(), s) - at.begin()) - 1, 0,
                               run.closed ? count - 1 : std::max(0, count - 2));
    const int high = low + 1 < count ? low + 1 : run.closed ? 0 : low;
    const double to = high == 0 && run.closed ? run.length() : at[high];
    const double along = high == low ? 0 : std::clamp((s - at[low]) / (to - at[low]), 0.0, 1.0);
    const double ring = options_.rings > 1 ? place->distance / radius * (options_.rings - 1) : 0;
    for (const auto& [which, weight] : {std::pair(low, 1 - along), std::pair(high, along)})
      for (int i = 0; i < options_.rings; ++i)
        if (const double hat = 1 - std::abs(ring - i); hat > 0 && weight > 0) {
          FrontGroup& group = groups[(of_run_[r].first + which) * options_.rings + i];
          group.nodes.push_back(j);
          group.weights.push_back(weight * hat);
        }
  }

  const FrontRuns& of_front_;
  const topology::Incision& incision_;
  const std::vector<topology::FrontSegment>& front_;
  const NodeCloud& nodes_;
  const FrontOptions& options_;
  topology::PointTree tree_;
  std::vector<MeasuredRun> runs_;
  std::vector<int> place_in_run_; // of every segment
  std::vector<Stations> of_run_;
  std::vector<FrontStation> all_;
};

} // namespace

std::vector<FrontGroup> front_groups(const FrontRuns& runs, const NodeCloud& nodes, const FrontOptions& options) {
  if (runs.count() == 0 || options.radius <= 0 || options.rings < 1)
    return {};
  return FrontStations(runs, nodes, options).groups();
}

TipFields tip_fields(const Material& material, const FrontPlace& place) {
  // A point on the front has no gradient.
  constexpr double least = 1e-12; // m
  const double ahead = std::abs(place.ahead) + std::abs(place.above) < least ? least : place.ahead;
  TipFields fields;
  for (int mode = 0; mode < 3; ++mode) {
    const TipField field = tip_field(material, Vector3::Unit(mode), ahead, place.above);
    fields.value.col(mode) = field.displacement;
    fields.by_ahead.col(mode) = field.gradient.col(0);
    fields.by_above.col(mode) = field.gradient.col(1);
  }
  return fields;
}

FrontFields front_fields(const Material& material, const FrontStation& station, const FrontPlace& place,
                         const TipFields& tip) {
  const Matrix3 axes = front_intensity(material, station) * station.axes;
  FrontFields fields;
  fields.value = axes * tip.value;
  const Matrix3 ahead = axes * tip.by_ahead, above = axes * tip.by_above;
  for (int mode = 0; mode < 3; ++mode)
    fields.gradient[mode] =
        ahead.col(mode) * place.grad_ahead.transpose() + above.col(mode) * place.grad_above.transpose();
  return fields;
}

double front_intensity(const Material& material, const FrontStation& station) {
  return 2 * material.shear_modulus() * std::sqrt(2 * std::numbers::pi / station.spacing);
}

} // namespace spherecut::solvers
