// Functions gathered along the front of a cut. Between the stations of the front and over the rings about it the
// near-tip fields of the three modes are blended by the spheres themselves:
//
//   [sum_J N_k(s_J) R_i(r_J) h_J(x)] u_m(a, b),
//
// N and R hats along and about the front, evaluated at the nodes; (a, b) the distances of x ahead of the front and
// above the sheet; u_m the field of a unit intensity [Williams 1957] along the axes of station k.
#pragma once

#include "solvers/fracture/stress_intensity.hpp"
#include "solvers/nodes/nodes.hpp"

#include <memory>
#include <optional>

namespace spherecut::solvers {

/// Where a point lies with respect to the front.
struct FrontPlace {
  double ahead = 0, above = 0;          // m; behind the front `above` changes its sign at the sheet
  Vector3 grad_ahead = Vector3::Zero(); // unit
  Vector3 grad_above = Vector3::Zero(); // unit
  double distance = 0;                  // m, to the front
  int segment = -1;                     // of Incision::front(), the nearest
  Vector3 nearest = Vector3::Zero();    // m, point of the front
};

/// With respect to the nearest front. Nothing farther than `reach` m from it. Continuous across everything but the
/// sheets, but for places as far from one front as from another.
std::optional<FrontPlace> front_place(const topology::Incision& incision, const Vector3& x, double reach);

/// Segments of the front that follow one another.
struct FrontRun {
  std::vector<int> segments;
  bool closed = false;
};

/// The runs of the front of an incision, and places with respect to one of them. Functions about one run know nothing
/// of the others: where two fronts come near to each other, the functions of both are smooth.
class FrontRuns {
 public:
  /// All runs of the front; open ones come first.
  explicit FrontRuns(std::shared_ptr<const topology::Incision> incision);

  [[nodiscard]] const topology::Incision& incision() const { return *incision_; }
  [[nodiscard]] const std::vector<FrontRun>& runs() const { return runs_; }
  [[nodiscard]] int count() const { return static_cast<int>(runs_.size()); }
  /// The run of a segment of Incision::front().
  [[nodiscard]] int run_of(int segment) const { return run_of_[segment]; }
  /// m, of a run.
  [[nodiscard]] double length(int run) const { return lengths_[run]; }
  /// Nothing farther than `reach` m from the run. Continuous across everything but the sheet of the run.
  [[nodiscard]] std::optional<FrontPlace> place(int run, const Vector3& x, double reach) const;

 private:
  std::shared_ptr<const topology::Incision> incision_;
  std::vector<FrontRun> runs_;
  std::vector<int> run_of_;               // of every segment
  std::vector<std::vector<char>> marked_; // segments of every run
  std::vector<BoundingBox> boxes_;        // of every run
  std::vector<double> lengths_;           // m, of every run
};

struct FrontOptions {
  double radius = 3;   // of the outer ring, in spacings at the front; 0: no functions
  double gather = 1.5; // from station to station, in the same units
  int rings = 3;       // the first on the front
};

/// One place along the front.
struct FrontStation {
  Vector3 point = Vector3::Zero();    // m
  Matrix3 axes = Matrix3::Identity(); // columns: ahead, normal, along
  double spacing = 0;                 // m, of the nodes there
};

/// One station and ring with the nodes that carry it. It stands for three unknowns, one a mode.
struct FrontGroup {
  FrontStation station;
  int run = -1; // of the front as it is now
  int ring = 0;
  std::vector<int> nodes; // ascending
  std::vector<double> weights;
  [[nodiscard]] bool operator==(const FrontGroup& other) const {
    return ring == other.ring && nodes == other.nodes && weights == other.weights &&
           station.point == other.station.point && station.axes == other.station.axes &&
           station.spacing == other.station.spacing;
  }
};

/// The groups of all runs of the front. An open run is measured from its older end, so that stations stay where they
/// are as the other end grows, and do not depend on the increments by which it has.
std::vector<FrontGroup> front_groups(const FrontRuns& runs, const NodeCloud& nodes, const FrontOptions& options);

/// Near-tip fields of unit intensity in the axes (ahead, normal, along): displacement of every mode in a column, m, and
/// its derivatives ahead and along the normal.
struct TipFields {
  Matrix3 value = Matrix3::Zero(), by_ahead = Matrix3::Zero(), by_above = Matrix3::Zero();
};
TipFields tip_fields(const Material& material, const FrontPlace& place);

/// The three fields at a place as a station has them, one a column, of unit size at one spacing from the front, with
/// their derivatives.
struct FrontFields {
  Matrix3 value;
  std::array<Matrix3, 3> gradient; // of every mode, du_i/dx_j, 1/m
};
FrontFields front_fields(const Material& material, const FrontStation& station, const FrontPlace& place,
                         const TipFields& tip);

/// K of every mode at a coefficient of 1, Pa sqrt(m): the fields above are dimensionless.
double front_intensity(const Material& material, const FrontStation& station);

} // namespace spherecut::solvers
