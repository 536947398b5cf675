#include "solvers/appended/front_places.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <utility>

namespace spherecut::solvers {

namespace {

constexpr double near_front_boxes = 3;  // half diagonals of a box: nearer to a front its octants count one by one
constexpr int front_samples_along = 4;  // an edge of such a box
constexpr double nearest_sample = 0.05; // half diagonals: samples count as this far from the front at least

} // namespace

// What is integrated goes with 1 / r. The octants of a part near the front count one by one, and the place of each
// stands where r is its harmonic mean over the octant.
PlacedPart FrontPlaces::sampled(const CutBoxes& cut, PartId part, const FrontPlace& middle) const {
  const CutPart whole = cut.part(part);
  const SmallBox& box = cut.boxes().boxes()[box_of(part)];
  const double radius = box.half.norm();
  const bool divided = cut.part_count(box_of(part)) > 1;
  const Vector3 half = box.half / front_samples_along;
  const Matrix3 across =
      middle.grad_ahead * middle.grad_ahead.transpose() + middle.grad_above * middle.grad_above.transpose();
  topology::SheetPoint sheet; // no part of an undivided box lies beyond it
  if (const auto nearest = incision_->closest(box.centre, radius))
    sheet = *nearest;
  const double side = divided ? sheet.normal.dot(whole.centroid - sheet.point) : 0;
  struct Octant {
    int count = 0;
    Vector3 sum = Vector3::Zero();
    double nearness = 0; // sum of 1 / r
  };
  std::array<Octant, 16> octants; // a sheet that ends in the box divides them
  int count = 0;
  for (int a = 0; a < front_samples_along; ++a)
    for (int b = 0; b < front_samples_along; ++b)
      for (int c = 0; c < front_samples_along; ++c) {
        const Vector3 x = box.centre - box.half + half.cwiseProduct(Vector3(2 * a + 1, 2 * b + 1, 2 * c + 1));
        const double above = sheet.normal.dot(x - sheet.point);
        if (above * side < 0 || (!box.whole && domain_.signed_distance(x) > 0))
          continue;
        Octant& own = octants[(a >= front_samples_along / 2 ? 1 : 0) + (b >= front_samples_along / 2 ? 2 : 0) +
                              (c >= front_samples_along / 2 ? 4 : 0) + (above >= 0 ? 8 : 0)];
        ++own.count;
        own.sum += x;
        own.nearness += 1 / std::max(nearest_sample * radius, (across * (x - middle.nearest)).norm());
        ++count;
      }
  PlacedPart samples;
  for (const Octant& octant : octants) {
    if (octant.count == 0)
      continue;
    PlacedSample sample;
    sample.share = static_cast<double>(octant.count) / count;
    sample.at = octant.sum / octant.count;
    sample.place = front_place(*incision_, sample.at, reach_);
    if (!sample.place)
      sample.place = middle;
    if (const double r = std::hypot(sample.place->ahead, sample.place->above); r > 0) {
      const double factor = octant.count / octant.nearness / std::max(r, 1e-6 * radius);
      sample.place->ahead *= factor;
      sample.place->above *= factor;
    }
    samples.push_back(std::move(sample));
  }
  return samples;
}

PlacedPart& FrontPlaces::of(const CutBoxes& cut, PartId part) {
  PlacedPart& known = places_[part];
  if (known.empty()) {
    const CutPart at = cut.part(part);
    const std::optional<FrontPlace> place = front_place(*incision_, at.centroid, reach_);
    if (place && place->distance < near_front_boxes * cut.boxes().boxes()[box_of(part)].half.norm())
      known = sampled(cut, part, *place);
    if (known.empty())
      known.push_back({1, at.centroid, place, {}});
    placed_.push_back(part);
  }
  return known;
}

/// A sample with respect to a run; null: the run is far from it.
PlaceAtRun* FrontPlaces::at_run(PlacedSample& sample, int run) const {
  if (!sample.place)
    return nullptr;
  for (PlaceAtRun& at : sample.runs)
    if (at.run == run)
      return &at;
  const std::optional<FrontPlace> place =
      runs_->run_of(sample.place->segment) == run ? sample.place : runs_->place(run, sample.at, reach_);
  if (!place)
    return nullptr;
  return &sample.runs.emplace_back(PlaceAtRun{run, *place, tip_fields(material_, *place), {}, {}});
}

/// Runs of places that stay, as they are numbered now. False: one of them is not there any more, and nothing is done.
bool FrontPlaces::renumber_runs(PlacedPart& kept, const std::vector<int>& segment_now) const {
  const auto is_there = [&](const FrontPlace& place) { return segment_now[place.segment] >= 0; };
  const bool all_there = std::all_of(kept.begin(), kept.end(), [&](const PlacedSample& sample) {
    return (!sample.place || is_there(*sample.place)) &&
           std::all_of(sample.runs.begin(), sample.runs.end(),
                       [&](const PlaceAtRun& at) { return is_there(at.place); });
  });
  if (!all_there)
    return false;
  for (PlacedSample& sample : kept) {
    if (sample.place)
      sample.place->segment = segment_now[sample.place->segment];
    for (PlaceAtRun& at : sample.runs) {
      at.place.segment = segment_now[at.place.segment];
      at.run = runs_->run_of(at.place.segment);
    }
  }
  return true;
}

/// What the segments of the front before are called now; -1: they have gone.
std::vector<int> FrontPlaces::segments_now(const FrontRuns* before) const {
  if (before == nullptr)
    return {};
  // A segment whose frame has turned is another.
  const auto key_of = [](const topology::Incision& incision, int s) {
    const topology::FrontSegment& segment = incision.front()[s];
    std::array<double, 19> key{};
    double* to = key.data();
    *to++ = segment.sheet;
    for (const Vector3& x : {segment.from, segment.to})
      to = std::copy_n(x.data(), 3, to);
    for (const double share : {0.0, 1.0}) {
      const topology::FrontFrame frame = incision.front_frame_at(s, share);
      to = std::copy_n(frame.ahead.data(), 3, to);
      to = std::copy_n(frame.normal.data(), 3, to);
    }
    return key;
  };
  std::map<std::array<double, 19>, int> now;
  for (int s = 0; s < std::ssize(incision_->front()); ++s)
    now[key_of(*incision_, s)] = s;
  std::vector<int> segments;
  segments.reserve(before->incision().front().size());
  for (int s = 0; s < std::ssize(before->incision().front()); ++s) {
    const auto found = now.find(key_of(before->incision(), s));
    segments.push_back(found == now.end() ? -1 : found->second);
  }
  return segments;
}

void FrontPlaces::find_runs_now(const FrontRuns* before, const std::vector<int>& segment_now) {
  run_now_.assign(before == nullptr ? 0 : static_cast<std::size_t>(before->count()), -1);
  std::vector<int> joined(static_cast<std::size_t>(runs_->count()), 0);
  for (int run = 0; run < std::ssize(run_now_); ++run) {
    std::set<int> now;
    for (const int segment : before->runs()[run].segments)
      if (segment_now[segment] >= 0)
        now.insert(runs_->run_of(segment_now[segment]));
    for (const int found : now)
      ++joined[found];
    if (now.size() == 1)
      run_now_[run] = *now.begin();
  }
  for (int& run : run_now_)
    if (run >= 0 && joined[run] > 1)
      run = -1;
}

/// Forgets the places of parts whose places of the fronts are others now: changed[box] becomes 2, unless the box itself
/// is another (1).
void FrontPlaces::follow(const CutBoxes& cut, std::shared_ptr<const topology::Incision> incision,
                         const BoundingBox& region, std::vector<char>& changed) {
  incision_ = std::move(incision);
  const std::shared_ptr<const FrontRuns> before_runs = std::exchange(runs_, std::make_shared<FrontRuns>(incision_));
  const std::vector<int> segment_now = segments_now(before_runs.get());
  find_runs_now(before_runs.get(), segment_now);
  // The nearest place of the front changes where the front did. Far from what has changed it is where it was.
  const auto is_far = [&](const Vector3& x, double radius, const PlacedPart& before) {
    const double away = (x - region.lower.cwiseMax(x.cwiseMin(region.upper))).norm();
    return std::all_of(before.begin(), before.end(), [&](const PlacedSample& sample) {
      double farthest = sample.place ? sample.place->distance : reach_;
      for (const PlaceAtRun& at : sample.runs)
        farthest = std::max(farthest, at.place.distance);
      return away > farthest + radius;
    });
  };
  const auto is_same = [](const FrontPlace& before, const FrontPlace& now) {
    return now.ahead == before.ahead && now.above == before.above && now.grad_ahead == before.grad_ahead &&
           now.grad_above == before.grad_above;
  };
  // What functions had asked for is asked for again.
  const auto are_same = [&](const PlacedSample& before, PlacedSample& now) {
    return now.place.has_value() == before.place.has_value() && (!now.place || is_same(*before.place, *now.place)) &&
           std::all_of(before.runs.begin(), before.runs.end(), [&](const PlaceAtRun& was) {
             const int segment = segment_now[was.place.segment];
             const PlaceAtRun* const is = segment < 0 ? nullptr : at_run(now, runs_->run_of(segment));
             return is != nullptr && is_same(was.place, is->place);
           });
  };
  const auto are_others = [&](const PlacedPart& before, PlacedPart& now) {
    return !std::equal(before.begin(), before.end(), now.begin(), now.end(), are_same);
  };
  std::vector<PartId> before_parts = std::move(placed_);
  placed_.clear();
  std::sort(before_parts.begin(), before_parts.end());
  for (const PartId part : before_parts) {
    const int box = box_of(part);
    PlacedPart before = std::exchange(places_[part], {});
    if (changed[box] == 1 || part % most_parts >= cut.part_count(box))
      continue;
    if (is_far(cut.boxes().boxes()[box].centre, cut.boxes().boxes()[box].half.norm(), before) &&
        renumber_runs(before, segment_now)) {
      places_[part] = std::move(before);
      placed_.push_back(part);
    } else if (are_others(before, of(cut, part))) {
      changed[box] = 2;
    }
  }
}

} // namespace spherecut::solvers
