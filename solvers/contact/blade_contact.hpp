// The edge of a blade against tissue: it deforms the tissue first, and cuts where that releases enough energy.
//
// Mechanics. A piece of the edge of length l stands against uncut material at a point of the rest frame: on the surface
// of the body before the first cut, on the front of the cut afterwards. It can push and not pull, along its way, with
// the force f >= 0 and without friction along the edge. Let x be how far the blade has gone and a how far the cut has:
// the edge has pushed the material ahead of it by x - a, so that with the compliance C(a) of the body at its front
//
//   f = (x - a) / C,   U = (x - a)^2 / 2C = f^2 C / 2,   dW = f dx,   G w = -dU/da at fixed x = f + f^2 C'(a) / 2
//
// for a front of width w. Work is either stored or spent on new surface, f dx = dU + G_c w da while it cuts [Atkins
// 2009, The Science and Engineering of Cutting; Mahvash and Hayward 2001, Haptic rendering of cutting, a fracture
// mechanics approach]. Where the block looks the same for every a, C' = 0 and the force is G_c w whatever the modulus
// and however sharp the edge. A pattern of contacts has vectors in place of x - a and f, and a matrix C.
//
// Width of the edge. The compliance under a line load is infinite: the edge must have a width. A round edge of radius r
// that carries the force of steady cutting, G_c per length, touches half an elastic body over the half width
// b = sqrt(4 r G_c (1 - nu^2) / (pi E)) [Hertz 1881], which for tissue is far larger than r because G_c / E is. The
// force of every piece of the edge is spread over the half disc of this radius ahead of it, at the surface as at the
// front: so compliance goes over continuously from the one to the other, and does not depend on the nodes once they are
// as fine as b.
//
// First cut. At the surface C' < 0: an edge in a notch has more material around it than one on a face. So the force
// must rise above G_c w before it cuts, and the cut begins with a finite length: no shorter one releases its own
// energy. That length needs no further constant. The blade cuts by the first length s for which, at fixed x, U(0) -
// U(s) >= G_c A(s) [finite fracture mechanics, Leguillon 2002, Taylor 2007], both from solves. The force then drops to
// about G_c w. The same difference of two solves decides every later increment.
//
// Sharpness. A share of the edge's work, 1 - sharpness, is lost in crushing beside the cut; the edge needs
// G_c / sharpness. Friction of the flanks is a given shear of their faces that drags the tissue along.
#pragma once

#include "solvers/contact/lip_contact.hpp"

namespace spherecut::solvers {

/// Half width b of the contact of a round edge at the force of steady cutting, m (above). Throws InputError when radius
/// or toughness is not positive and finite.
double edge_half_width(const Material& material, double edge_radius, double toughness);

/// A piece of the edge and the material it stands against, rest frame.
struct EdgeContact {
  Vector3 point = Vector3::Zero();   // m, on the front or, where nothing is cut, on the surface
  Vector3 push = -Vector3::UnitZ();  // unit, its way, across the edge unless that is given
  Vector3 normal = Vector3::UnitX(); // unit, of the sheet that it makes; across `push`
  double length = 0;                 // m, of edge
  Vector3 edge = Vector3::Zero(); // unit, across `normal`, not along `push`: of an edge that slices; zero: it does not
  /// Of the sheet's front, in the sheet and across the edge, on the side of `push`.
  [[nodiscard]] Vector3 ahead() const;
  /// Area that a metre of its way cuts, m.
  [[nodiscard]] double swept_width() const { return length * push.dot(ahead()); }
  bool operator==(const EdgeContact&) const = default;
};

/// One newton along `push`, spread over the half disc of radius `half_width` ahead of the edge with the weight
/// 1 - (r/b)^2, along its length. Points outside the body are left out. Throws InputError when none is inside.
ForcePattern edge_pattern(const EdgeContact& contact, double half_width, const topology::Domain& domain);

/// A piece of the flanks: both faces of a sheet lie against them there.
struct FlankPoint {
  Vector3 point, normal; // m, on a sheet; its unit normal
  double area = 0;       // m2, of one face
};

/// Drag of the flanks on the tissue when they slide along `way` (unit): `shear` Pa on either face.
ForcePattern drag_pattern(const std::vector<FlankPoint>& flanks, double shear, const Vector3& way, double spacing);

/// The body seen from edge, lips and flanks. Entries come contacts first (displacement along `push`, m, per N), then
/// pairs of lips (normal opening), then the drag if there is one (its pattern at amplitude 1). Displacements are
/// base + compliance * forces. The compliance is symmetrised: an energy needs that, and that of `collocation` is
/// symmetric to discretisation error alone.
struct BladePatch {
  std::vector<EdgeContact> contacts;
  std::vector<LipPair> pairs; // whose faces may touch; empty: they are left open
  bool dragged = false;
  ForcePattern flanks;            // of the drag
  Vector3 drag = Vector3::Zero(); // N, on the tissue at amplitude 1
  /// Of the drag at amplitude 1 on the tissue about the frame's origin: N m with its faces where `base` has them, and
  /// what a unit of every entry adds by moving them (a column an entry). Empty without drag.
  Vector3 drag_torque = Vector3::Zero();
  MatrixX drag_torques;
  MatrixX compliance;
  VectorX base;
  VectorX free; // m, one an entry: its displacement without blade
  /// J, of edge and lips beyond forces * compliance * forces / 2 where the edge presses: not 0 where the entries are
  /// those of small motions about a state at finite strain.
  double energy = 0;
  std::vector<Field> responses; // none at finite strain
  MatrixX held_forces;          // N, of a unit of every entry, on the body at shares that a tool holds: 3 rows each
  MatrixX patterns;             // there: a unit of every entry, on the nodes
};

/// Condenses onto contacts, pairs (may be empty) and drag (may hold no points). `base` is the field without blade.
/// `known` (may be null): a patch of the same body, half width and `held`, whose responses are taken over where
/// contacts, pairs and drag are its own. `held` (may be null): the shares of this patch are held where they are in
/// `base`. Throws InputError without contacts.
BladePatch condense_blade(const Discretisation& body, const Field& base, const std::vector<EdgeContact>& contacts,
                          double half_width, const std::vector<LipPair>& pairs = {}, const ForcePattern& drag = {},
                          const BladePatch* known = nullptr, const ContactPatch* held = nullptr);

/// Tissue under the blade.
struct BladeState {
  VectorX advance;                       // m, of the blade past each contact's rest position along its push
  VectorX forces;                        // N, one an entry; the amplitude of the drag last
  VectorX displacements;                 // one an entry
  double driving = 0;                    // J, energy of edge and lips that a cut can release at fixed blade
  double stored = 0;                     // J, elastic, with what the drag adds, against the body without blade
  Vector3 edge_force = Vector3::Zero();  // N, of the tissue on the edge
  Vector3 blade_force = Vector3::Zero(); // N, of the tissue on the blade: edge and flanks
  bool converged = true;
};

/// Blade at `advance` (one a contact), its flanks dragging by `drag` (-1 to 1; 0 at rest): no contact pulls, none gives
/// way less than the blade asks, no lips go through one another.
BladeState push_blade(const BladePatch& patch, const VectorX& advance, double drag = 0);

/// Torque of the tissue on a blade, N m.
struct BladeTorque {
  Vector3 edge = Vector3::Zero();  // of the edge alone
  Vector3 blade = Vector3::Zero(); // of edge and flanks
};

/// About a point, m, of the forces of a state: every piece of the edge bears its force where it is now (`places`, m,
/// one a contact), the flanks bear their drag where the faces are that they rub. Turning the blade by a small angle
/// about the point works against the edge's torque as moving it works against its force. Throws InputError unless there
/// is a place for every contact.
BladeTorque blade_torque(const BladePatch& patch, const BladeState& state, const std::vector<Vector3>& places,
                         const Vector3& about);

/// Field of the body under the blade.
Field deform(const BladePatch& patch, const BladeState& state, const Field& base);

/// Energy release rate of a front that moves with the edge, J/m2: forces . motion + forces C' forces / 2 per area
/// swept, where the contacts move by `motion` (m) along their pushes per unit of a parameter with which the compliance
/// of the contacts changes at the rate `slope` (0 x 0: it stays).
double energy_release(const BladePatch& patch, const BladeState& state, const VectorX& motion,
                      const MatrixX& slope = {});

/// A straight motion of the blade as one patch sees it.
struct BladeStroke {
  VectorX from, to; // m, advance past each contact
  [[nodiscard]] VectorX at(double share) const { return from + share * (to - from); }
};

/// First share of a stroke (to 1e-9) at which the cut that takes the body `now` into the body `cut` releases `needed` J
/// at fixed blade, by difference of the two; nullopt when it does at none of its eighths. `needed` > 0. A `cut` without
/// contacts leaves the blade nothing to press on.
std::optional<double> cutting_share(const BladePatch& now, const BladeStroke& stroke, const BladePatch& cut,
                                    const BladeStroke& cut_stroke, double needed, double drag = 0);

/// Where the work of a blade goes, J.
struct BladeLedger {
  double work = 0;     // integral of force over motion
  double surface = 0;  // toughness times area
  double crushing = 0; // beside a blunt edge
  double friction = 0; // of the flanks
  double excess = 0;   // released beyond need where a cut came late, or where tissue slips off the edge
  double stored = 0;   // elastic, in the tissue now

  /// A motion of the blade at a given cut, short enough for forces to change evenly. `motion`, m, is how far each piece
  /// of the edge went along its push: what the state's advance falls short of, tissue has slipped off the edge.
  /// `slide`, m, is how far the flanks went.
  void move(const BladePatch& patch, const BladeState& from, const BladeState& to, const VectorX& motion, double slide);
  /// A cut of `area` m2 at fixed blade.
  void cut(const BladeState& before, const BladeState& after, double toughness, double sharpness, double area);
  /// |work - all the others| over the work; 0 without work.
  [[nodiscard]] double imbalance() const;
};

} // namespace spherecut::solvers
