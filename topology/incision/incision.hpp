// The incision in the rest frame: triangulated sheets that sight lines cannot cross, and the front where they end.
#pragma once

#include "topology/domain/domain.hpp"

#include <limits>
#include <memory>
#include <optional>
#include <span>

namespace spherecut::topology {

/// Piece of the front: the border of a sheet strictly inside the body.
struct FrontSegment {
  Vector3 from, to; // m; the sheet lies on the left of from -> to seen from its + side
  int sheet = -1;
};

/// Local frame of the front nearest to a point. Polar coordinates about it: r = |x - point| in the plane of `ahead` and
/// `normal`, theta = atan2((x - point) . normal, (x - point) . ahead), +-pi on the two faces of the sheet.
struct FrontFrame {
  Vector3 point = Vector3::Zero();   // m, on the front
  Vector3 ahead = Vector3::Zero();   // unit, in the tangent plane of the sheet, out of it (direction of growth)
  Vector3 normal = Vector3::Zero();  // unit normal of the sheet, to its + side
  Vector3 tangent = Vector3::Zero(); // unit, along the front: normal x ahead
  double distance = std::numeric_limits<double>::infinity(); // m
  int segment = -1;                                          // index into Incision::front()
};

/// Nearest point of the sheets.
struct SheetPoint {
  Vector3 point = Vector3::Zero();                           // m
  Vector3 normal = Vector3::Zero();                          // unit, to the + side; that of the nearest triangle
  double distance = std::numeric_limits<double>::infinity(); // m, unsigned
  int sheet = -1, triangle = -1;
  bool on_border = false; // the nearest point lies on the border of its sheet
};

/// An end of a sight line. One on a face of a cut looks over the bulges of the face from `lifted` as well
/// (lip_lift.hpp).
struct Eye {
  Vector3 at, lifted; // m; the same away from the faces
  Eye(const Vector3& x) : at(x), lifted(x) {}
  Eye(const Vector3& x, const Vector3& off) : at(x), lifted(off) {}
  [[nodiscard]] bool on_face() const { return lifted != at; }
};

/// Shortest way from one point to another around the front.
struct Detour {
  double length = 0;              // m, |x - over| + |over - y|
  Vector3 over = Vector3::Zero(); // m, point of the front
};

/// All sheets of a cut body at one moment. Immutable; queries are thread safe and allocate at a thread's first alone.
class Incision {
 public:
  /// Sheets are open or closed, consistently oriented, 2-manifold with border; they may reach out of the body and cross
  /// one another. `revision` counts the increments that led here. Throws InputError naming the sheet and the element
  /// when one is not finite, not manifold, not orientable, degenerate, or lies outside the body.
  /// `walls` are further sheets, in the gaps of the body's own surface (gap_walls.hpp): not checked, without area, and
  /// after the sheets in number. Their border inside the body is a front as that of any sheet.
  Incision(std::vector<SurfaceMesh> sheets, std::shared_ptr<const Domain> domain, int revision = 0,
           std::vector<SurfaceMesh> walls = {});
  ~Incision();
  Incision(const Incision&) = delete;
  Incision& operator=(const Incision&) = delete;

  /// The walls are among them, from cut_sheets() on.
  [[nodiscard]] const std::vector<SurfaceMesh>& sheets() const;
  [[nodiscard]] int cut_sheets() const;
  [[nodiscard]] const std::shared_ptr<const Domain>& domain() const;
  [[nodiscard]] int revision() const;
  /// Border of all sheets inside the body, clipped at its surface.
  [[nodiscard]] const std::vector<FrontSegment>& front() const;
  /// Area of the sheets inside the body without the walls, m2, and length of the front, m.
  [[nodiscard]] double area() const;
  [[nodiscard]] double front_length() const;

  /// Whether the closed segment from a to b meets a sheet (touching counts).
  [[nodiscard]] bool blocks(const Vector3& a, const Vector3& b) const;

  /// The triangles that may meet a segment from some point of the box centre +- half, m, to y, as numbers for the next
  /// query. When there are none no such segment is blocked. False where there are more than `most`, of which `walls`
  /// has as many then.
  bool walls_between(const Vector3& centre, const Vector3& half, const Vector3& y, std::size_t most,
                     std::vector<int>& walls) const;

  /// Sheet and triangle that such a number stands for.
  [[nodiscard]] std::pair<int, int> triangle_of(int wall) const;

  /// What blocks(a, b) says, for a in a box whose walls before b are given; changes their order, the one that blocks
  /// comes first.
  [[nodiscard]] bool blocks(const Vector3& a, const Vector3& b, std::span<int> walls) const;

  /// What blocks(a, b) says, sooner where the triangle `wall` is the one that blocks; sets it to the one that does.
  [[nodiscard]] bool blocks(const Vector3& a, const Vector3& b, int& wall) const;

  /// False when no sheet comes nearer to x than `radius` m: then no sight line inside that ball is blocked. May be true
  /// without need. A few nanoseconds far from the sheets.
  [[nodiscard]] bool near(const Vector3& x, double radius) const;

  /// Nearest point of the sheets within `reach` m; nullopt when there is none.
  [[nodiscard]] std::optional<SheetPoint> closest(const Vector3& x, double reach) const;
  /// The same of one sheet alone.
  [[nodiscard]] std::optional<SheetPoint> closest_of(int sheet, const Vector3& x, double reach) const;

  /// Frame of the nearest point of the front within `reach` m; nullopt when there is none. Depends on the segments
  /// within reach alone, not on their order: of two as near, the one with the lexicographically smaller ends counts.
  [[nodiscard]] std::optional<FrontFrame> front_frame(const Vector3& x, double reach) const;

  /// The same of those segments alone that are marked, one entry a segment.
  [[nodiscard]] std::optional<FrontFrame> front_frame_among(const std::vector<char>& marked, const Vector3& x,
                                                            double reach) const;

  /// Frame at the point from + share (to - from) of a segment of the front, share in [0, 1]; its distance is 0.
  [[nodiscard]] FrontFrame front_frame_at(int segment, double share) const;

  /// Whether the sheets hide two eyes from each other.
  [[nodiscard]] bool hides(const Eye& x, const Eye& y) const;

  /// The same for eyes the straight segment between which is known to be blocked.
  [[nodiscard]] bool hides_blocked(const Eye& x, const Eye& y) const;

  /// Shortest detour around the front no longer than `reach` m, both of whose legs are clear; nullopt when there is
  /// none. Meant for x and y that do not see each other. The search is short when it begins at the `first` segment of
  /// the front and that lies near the way; of ways as short the one over it counts. Where the shortest way is blocked,
  /// the next ones are looked at, 64 at most, each 0.03 of `reach` away from those that were blocked: a clear way up to
  /// that much shorter may be passed over.
  [[nodiscard]] std::optional<Detour> detour(const Eye& x, const Eye& y, double reach, int first = -1) const;

 private:
  [[nodiscard]] std::optional<SheetPoint> closest_where(const Vector3& x, double reach, int sheet) const;
  [[nodiscard]] std::optional<FrontFrame> front_frame_where(const Vector3& x, double reach,
                                                            const std::vector<char>* marked) const;
  struct Data;
  struct DetourSearch;
  std::unique_ptr<const Data> data_;
};

} // namespace spherecut::topology
