// The surface of an organ after any cut: closed and 2-manifold, with two lips and two walls at every sheet.
//
// The organ's surface and the sheets are subdivided exactly along their intersections (exact_arrangement.hpp). What is
// left of the sheets inside the organ counts twice, as two walls facing each other. Around every edge each wedge of
// material is bounded by two of these faces, which become neighbours; corners that are linked across such neighbours
// become one vertex. So the rim and the walls part wherever material is parted, and the front stays single, for any
// sheets: partial, through, closed, buried, crossing, coincident, in any position.
#pragma once

#include "topology/surface/mesh.hpp"

#include <memory>
#include <optional>
#include <string>

namespace spherecut::topology {

/// wall_plus bounds the material on the + side of its sheet (to which the sheet's normal points), so its own outward
/// normal is against the sheet's; wall_minus bounds the material on the other side.
enum class WoundPart : std::uint8_t { organ, wall_plus, wall_minus };

/// A connected component of the wound's surface.
struct WoundComponent {
  double volume = 0; // m3, enclosed; negative or zero for a cavity
  int triangles = 0;
  int euler = 0;  // V - E + F
  int piece = -1; // of material that it bounds
};

/// Connected material: an outer component, and the cavities within it.
struct WoundPiece {
  double volume = 0; // m3
  int triangles = 0;
  int euler = 0; // sum over its components
  int components = 0;
};

struct Wound {
  SurfaceMesh surface; // closed, 2-manifold, outward from the material
  // Per triangle:
  std::vector<WoundPart> part;
  std::vector<int> sheet;           // -1: organ
  std::vector<int> source_triangle; // of the organ or of the sheet
  std::vector<int> component;       // into components
  // Per vertex:
  std::vector<int> point;          // copies of one point of the cut share this number
  std::vector<Vector3> evaluation; // m; where a field is evaluated for this vertex: moved off the walls into their
                                   // own side; the vertex itself away from the cut and on the front
  std::vector<WoundComponent> components;
  std::vector<WoundPiece> pieces; // at least one

  [[nodiscard]] int piece_of(int triangle) const { return components[component[triangle]].piece; }
};

struct WoundOptions {
  double evaluation_offset = 0; // m, how far evaluation points move off the walls; 0: 1e-4 of the longest edge there
};

/// Wound of sheets (open or closed, in the rest frame, of any position) in an organ (closed, outward, free of
/// self-intersections). Sheet triangles without area are left out. The volume is kept to rounding. Throws InputError
/// when the organ is not closed or a sheet has numbers that are not finite or indices out of range, naming it.
Wound cut_surface(const SurfaceMesh& organ, const std::vector<SurfaceMesh>& sheets, const WoundOptions& options = {});

/// Two vertices at one place of the cut, on the + and on the - side of a sheet.
struct LipPair {
  int plus, minus;
};

/// All pairs of vertices of facing walls that have parted, ascending. At a line where sheets cross, a vertex can be in
/// several.
std::vector<LipPair> lip_pairs(const Wound& wound);

/// A number that tells whether two surfaces have the same triangles at the same places, whatever their order.
std::uint64_t surface_hash(const SurfaceMesh& surface);

/// Nothing when every vertex is used, every half-edge has exactly one opposite and every vertex one fan of triangles;
/// otherwise the first defect.
std::optional<std::string> manifold_defect(const SurfaceMesh& surface);

/// A wound that follows growing sheets. Every increment redoes the neighbourhood of what it touches and gives the same
/// surface as cutting at once.
class IncrementalWound {
 public:
  explicit IncrementalWound(const SurfaceMesh& organ, const WoundOptions& options = {});
  ~IncrementalWound();
  IncrementalWound(IncrementalWound&&) noexcept;
  IncrementalWound& operator=(IncrementalWound&&) noexcept;

  /// The wound now. Numbers of triangles and vertices hold until the next growth.
  [[nodiscard]] const Wound& wound() const;

  struct Growth {
    int crossed = 0; // organ and sheet triangles that were subdivided anew
    int rebuilt = 0; // triangles of the wound that were replaced
  };
  /// The sheets now: each begins with the triangles it had, in the same places; new ones follow, and new sheets follow
  /// the old. Throws InputError when they do not, or as cut_surface; the wound is then as before.
  Growth grow(const std::vector<SurfaceMesh>& sheets);

 private:
  struct Data;
  std::unique_ptr<Data> data_;
};

} // namespace spherecut::topology
