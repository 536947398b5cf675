// A blade and the sheets that its edge sweeps through the tissue.
#pragma once

#include "topology/blade/rest_position.hpp"
#include "topology/incision/incision.hpp"

#include <Eigen/Geometry>
#include <string>

namespace spherecut::topology {

/// The cutting edge of a rigid blade, a polyline in the blade's own frame.
struct Blade {
  std::vector<Vector3> edge; // m, at least 2 points
  double edge_radius = 1e-4; // m, finite, for its force: an edge of no width has no stiffness against tissue
};

/// Where the blade is: x = orientation * point of the blade + position.
struct BladePose {
  double time = 0; // s
  Vector3 position = Vector3::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
};

/// Where a point of the blade's frame is.
inline Vector3 placed(const BladePose& pose, const Vector3& point) {
  return pose.orientation * point + pose.position;
}

/// Throws InputError unless the blade has 2 finite points or more, none on its neighbour, and a positive radius.
void check(const Blade& blade);

struct SweepOptions {
  double edge = 0.002;          // m, length of the triangles' edges: of edge polyline and motion between two rows
  double minimum_step = 0.05;   // in units of edge: less motion is held back until more has come together
  double sharp_turn = 60;       // degrees between the normals of two strips above which a new sheet starts
  int most_triangles = 500'000; // refused above, InputError
};

/// New triangles of one sheet.
struct AddedTriangles {
  int sheet, first, count; // indices into sheets() and its triangles
};

struct SweepResult {
  int triangles = 0;                   // added
  double area = 0;                     // m2, of these, inside the body
  std::vector<AddedTriangles> added{}; // where; a sheet appears once
  std::string refused{};               // why nothing was added; empty when something was
};

/// Sheets swept by one blade through one body, in the rest frame. Each motion appends a strip between the last place of
/// the edge and the new one, divided so that no triangle is longer than about `edge`. Sheets are append-only: vertices
/// and triangles keep their places. Their + side is that of edge direction x motion.
///
/// A strip extends the sheet it starts from. It starts a sheet of its own where the edge was out of the body or too far
/// from it (over one `edge`), where the motion turns sharply, where the blade turns about a point within its edge, and
/// where the strip would cross the sheet it belongs to. New sheets abut on the old ones with the same vertices: where
/// the edge comes out of an earlier sheet, or to one, by its border, the strip begins or ends at the border's vertices,
/// which lie up to 0.75 `edge` along it.
/// Nothing is added by a motion along the edge itself, nor where a sheet is already (within a quarter of `edge`: a hand
/// trembles, and no node sees into what would be left between), nor by an end of the edge that reaches out beside a
/// sheet by less than that: moving out of a cut and in again extends it from its front.
/// Sheets reach past the surface of the body by up to about one `edge`; a sheet that never reaches inside is not given.
class BladeSweep {
 public:
  /// Throws InputError when the blade or an option is not usable.
  BladeSweep(Blade blade, std::shared_ptr<const Domain> domain, const SweepOptions& options = {});
  ~BladeSweep();
  BladeSweep(const BladeSweep& other);
  BladeSweep& operator=(const BladeSweep& other);
  BladeSweep(BladeSweep&&) noexcept;
  BladeSweep& operator=(BladeSweep&&) noexcept;

  /// Moves the blade; the first call only places it. `to_rest` maps points of the deformed body, by default the
  /// identity; between poses the motion is a straight line with an even turn in the deformed frame, mapped as the body
  /// is now. Throws InputError when the pose is not finite, not later than the last one, or too many triangles would
  /// result, NumericalError when the map gives points that are not finite, and passes on what the map throws; then
  /// nothing has changed.
  SweepResult move_to(const BladePose& pose, const RestMap& to_rest = {});

  /// The next motion starts afresh from wherever it places the blade (the blade was lifted).
  void lift();

  /// A sheet that is cut already, as a precut or the seed of a tear is, comes after those of sheets(). The blade does
  /// not cut where it lies, and cuts on from its border. Throws InputError where check_sheet() does.
  void add(const SurfaceMesh& sheet);

  /// Sheet `sheet` of sheets() has grown otherwise, by a tear: `grown` is that sheet continued, vertices and triangles
  /// in their places. The next strip starts a sheet of its own, from where the edge is. Throws InputError when there is
  /// no such sheet or it has not grown.
  void extend(int sheet, const SurfaceMesh& grown);

  [[nodiscard]] std::vector<SurfaceMesh> sheets() const;
  /// Number of motions that added something.
  [[nodiscard]] int revision() const;
  /// sheets() as an incision; the same object until the next motion that adds something.
  [[nodiscard]] std::shared_ptr<const Incision> incision() const;
  [[nodiscard]] const Blade& blade() const;

  /// Edge in the rest frame where the blade was last placed, resampled; empty before the first pose and after lift().
  [[nodiscard]] const std::vector<Vector3>& edge_at_rest() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

} // namespace spherecut::topology
