// Where the parts of the boxes lie with respect to the fronts of a cut, and the near-tip fields there.
#pragma once

#include "solvers/appended/cut_boxes.hpp"
#include "solvers/appended/front_functions.hpp"

#include <algorithm>
#include <memory>

namespace spherecut::solvers {

/// A place with respect to one run of the front, and the near-tip fields there.
struct PlaceAtRun {
  int run = -1;
  FrontPlace place;
  TipFields tip;
  // The fields as the station had them that was asked for last: its rings follow one another.
  FrontStation station; // of no spacing: none yet
  FrontFields fields;
};

/// Place of a part, or of a sample of it, with respect to the fronts.
struct PlacedSample {
  double share = 1;                // of the part's volume
  Vector3 at = Vector3::Zero();    // m, centroid
  std::optional<FrontPlace> place; // with respect to the nearest front; of no value: far from every front
  std::vector<PlaceAtRun> runs;    // those that functions have asked for
};
/// One sample, or several where the near-tip fields change much within the part. The functions of the uncut body stay
/// linear over all of them, so that their products with one another are what they are without the samples.
using PlacedPart = std::vector<PlacedSample>;

/// Places are found as they are asked for, and kept until the fronts about them change.
class FrontPlaces {
 public:
  /// The domain outlives this. `reach`, m: places farther from every front know of none. `cut`, here and below: the
  /// same boxes, as they are.
  FrontPlaces(const CutBoxes& cut, const topology::Domain& domain, const Material& material, double reach)
      : domain_(domain), material_(material), reach_(reach),
        places_(most_parts * static_cast<std::size_t>(cut.boxes().size())) {}

  /// After the boxes have followed the cut, which changed in `region` alone. `changed`, by box: 1 where its parts are
  /// others now; becomes 2 where they are the same and lie elsewhere with respect to the fronts.
  void follow(const CutBoxes& cut, std::shared_ptr<const topology::Incision> incision, const BoundingBox& region,
              std::vector<char>& changed);

  [[nodiscard]] const FrontRuns& runs() const { return *runs_; }
  /// What the last follow() has made of the number of a run: -1 where the run has gone, or is not one run any more that
  /// no other has joined.
  [[nodiscard]] int run_now(int before) const { return run_now_[before]; }
  [[nodiscard]] PlacedPart& of(const CutBoxes& cut, PartId part);
  /// How many samples a part has as far as it has been asked for.
  [[nodiscard]] int known_samples(PartId part) const { return std::max(1, static_cast<int>(places_[part].size())); }
  /// A sample with respect to a run; null: the run is far from it. Valid until the next run is asked for.
  [[nodiscard]] PlaceAtRun* at_run(PlacedSample& sample, int run) const;
  /// A place with respect to a run; of no value: the run is far.
  [[nodiscard]] std::optional<FrontPlace> of_run(const Vector3& x, int run) const {
    return runs_->place(run, x, reach_);
  }
  /// With respect to the nearest front; of no value: all are far.
  [[nodiscard]] std::optional<FrontPlace> nearest(const Vector3& x) const { return front_place(*incision_, x, reach_); }

 private:
  [[nodiscard]] PlacedPart sampled(const CutBoxes& cut, PartId part, const FrontPlace& middle) const;
  [[nodiscard]] std::vector<int> segments_now(const FrontRuns* before) const;
  void find_runs_now(const FrontRuns* before, const std::vector<int>& segment_now);
  bool renumber_runs(PlacedPart& kept, const std::vector<int>& segment_now) const;

  const topology::Domain& domain_;
  Material material_;
  double reach_;
  std::shared_ptr<const topology::Incision> incision_;
  std::shared_ptr<const FrontRuns> runs_;
  std::vector<PlacedPart> places_; // by part; without samples: not asked for yet
  std::vector<PartId> placed_;     // those that are there
  std::vector<int> run_now_;       // of every run before
};

} // namespace spherecut::solvers
