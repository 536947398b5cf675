// One interface for the three discretisations of linear elasticity by finite spheres. A discretisation is assembled and
// factored once; loads, contact and haptics then work with its condensed responses.
#pragma once

#include "solvers/body/held_region.hpp"
#include "solvers/elasticity/regions.hpp"
#include "solvers/nodes/nodes.hpp"
#include "solvers/shapes/sight.hpp"
#include "solvers/shapes/tuning.hpp"

#include <functional>
#include <memory>
#include <optional>
#include <string_view>

namespace spherecut::solvers {

enum class Method {
  published,   // the paper: point collocation of the differential equation [De 2001]
  collocation, // collocation of the force balance of each node's cell
  galerkin,    // method of finite spheres in weak form
};
std::string_view to_string(Method method);
/// Throws InputError naming the value and the three allowed names.
Method method_from_string(std::string_view name);
/// Whether a cut body's nodes should have a ring ahead of the front (SprinkleOptions::ring_ahead). The cells of point
/// collocation then end along the front, and no face lies where the stress is singular; the weak form gains nothing by
/// it (docs/experiments/precut_straight.md).
bool wants_ring_ahead(Method method);

/// Prescribed displacement of one node. Free components carry no constraint.
struct Prescribed {
  int node = -1;
  std::array<bool, 3> components{true, true, true};
  Vector3 value = Vector3::Zero(); // m
};

/// What loads the body besides the tool. Null functions mean zero.
struct Loads {
  std::function<Vector3(const Vector3& x)> body_force;                      // N/m3
  std::function<Vector3(const Vector3& x, const Vector3& normal)> traction; // Pa on the surface
  /// Pa on the faces of the incision; the normal points out of the material, into the cut.
  std::function<Vector3(const Vector3& x, const Vector3& normal)> lip_traction;
  Matrix3 initial_strain = Matrix3::Zero(); // stress-free strain, subtracted from the strain (pre-tension: negative)
};

/// A boundary value problem on a node cloud. Surface that is neither prescribed nor loaded is free.
struct Problem {
  std::shared_ptr<const topology::Domain> domain;
  std::shared_ptr<const topology::Incision> incision; // null: uncut
  /// The incision with the walls of narrow gaps of the body's own surface (with_walls in gap_walls.hpp): what sight
  /// lines cannot cross. Null: the incision alone.
  std::shared_ptr<const topology::Incision> opaque;
  NodeCloud nodes;
  Material material;
  /// Parts with a material of their own; null: none. `galerkin` without a cut alone.
  std::shared_ptr<const MaterialRegions> regions;
  std::vector<Prescribed> prescribed;
  Loads loads;
  /// The part of the surface that `prescribed` holds, told point by point. With it the weak form holds the mean over
  /// each node's share of that part, for every entry of the part held along its components; without it, the nodes
  /// themselves. A node may have several entries, for axes that are held on different parts.
  HeldRegion prescribed_region;
  /// Prescribed displacement anywhere on that part, m. Null: Prescribed::value, constant over a node's share.
  std::function<Vector3(const Vector3& x)> prescribed_field;
  /// Unit vector out of the body towards the tool that is going to touch it. Forces on a node at a sharp edge act on
  /// the side of its share that faces the tool; where none does alone, on the edge. Empty: on the whole share.
  std::optional<Vector3> touched_from;
  Tuning tuning{};

  [[nodiscard]] const std::shared_ptr<const topology::Incision>& hiding() const { return opaque ? opaque : incision; }
  [[nodiscard]] const Material& material_at(const Vector3& x) const {
    return regions != nullptr ? regions->material_at(x, material) : material;
  }
};

/// What becomes of a piece that is cut off and that no prescribed displacement holds.
enum class UnheldPieces {
  refuse, // InputError that says which
  hold,   // six soft springs on three of its nodes: exact under loads in balance, which leave the springs unloaded
  drop,   // its unknowns are taken out and its displacement is zero
};
std::string_view to_string(UnheldPieces treatment);
/// Throws InputError naming the value and the three allowed names.
UnheldPieces unheld_pieces_from_string(std::string_view name);

struct DiscretisationOptions {
  Method method = Method::galerkin;
  double support_radius = 0;             // rho, radius / h (galerkin: / reach, below nu = 0.45); 0: the default
  int quadrature = 2;                    // rule of a background cell, exact to degree 2 quadrature - 1 (galerkin)
  double cell_size = 0.75;               // edge of a background cell in units of h (galerkin)
  int tip_node = -1;                     // the tool-tip node of `published`
  SightRule sight = SightRule::enriched; // only where there is an incision
  /// The body will be cut: `galerkin` takes the spheres of cut bodies from the start, so that the first cut changes
  /// nothing away from it.
  bool cut_ahead = false;
  /// A cut that appends has functions of the near-tip fields along its front: few unknowns, and the intensities. False:
  /// its spheres have steps alone, for a body on which something presses near the front or whose cut goes on.
  bool tip_functions = true;
  UnheldPieces unheld = UnheldPieces::refuse; // galerkin, collocation
  bool estimate_condition = true;             // a dozen more solves; leave out where every rebuild counts
};

/// Nodes that couple among themselves alone.
struct Piece {
  std::vector<int> nodes;             // ascending
  Vector3 centroid = Vector3::Zero(); // m, mean of the nodes
  bool held = false;                  // by some prescribed displacement
};

/// Diagnostics of assembly and factorisation. Times are wall clock, s.
struct AssemblyReport {
  int nodes = 0;
  int unknowns = 0;
  long matrix_nonzeros = 0;
  long factor_nonzeros = 0;
  double condition_estimate = 0;     // 1-norm estimate (Hager-Higham), 0 when not asked for
  double worst_moment_condition = 0; // largest condition number of a moment matrix
  int grown_supports = 0;            // supports whose radius had to grow
  std::vector<Piece> pieces;         // one for a body that is not cut apart
  double supports_seconds = 0, assembly_seconds = 0, factor_seconds = 0;
};

/// A solution: nodal coefficients alpha_j of u_h = sum_j h_j alpha_j [De 2001, Eq. 1] (3N, node-major) and, for the
/// mixed form, nodal pressures (N, else empty). It remembers the loads and prescribed displacements it answers to, so
/// that superposed fields keep their forces.
struct Field {
  VectorX coefficients;
  VectorX pressure;       // Pa
  double load_factor = 0; // multiple of problem().loads acting
  VectorX prescribed;     // m, 3 per entry of problem().prescribed

  /// field += factor * other. Throws InputError when the two are not of the same body.
  void add(double factor, const Field& other);
};

/// Value of a field at a point.
struct PointState {
  Vector3 displacement = Vector3::Zero(); // m
  Matrix3 gradient = Matrix3::Zero();     // du_i/dx_j
  Matrix3 strain = Matrix3::Zero();
  Matrix3 stress = Matrix3::Zero(); // Pa
};

/// A force that is spread over points inside the body: at amplitude 1 `forces` (N) act on `points` (m). Conjugate to
/// the amplitude is the displacement sum of forces . u(points), N m.
struct ForcePattern {
  std::vector<Vector3> points;
  std::vector<Vector3> forces;
};

/// What cases of forces on nodes do to the body.
struct CaseResponses {
  MatrixX among;             // N m, work that every case (rows) does on the displacements under every case (columns)
  MatrixX at;                // m, displacements of other nodes (3 each, rows) under every case
  std::vector<Field> fields; // under every case; none where the method knows the rest without them
};

struct ShapeFunctions;  // solvers/shapes/functions.hpp
struct QuadraturePoint; // solvers/quadrature/background_cells.hpp
/// Takes a point of the weak form, with the shape functions that the method has there.
using PointVisitor = std::function<void(const QuadraturePoint& point, const ShapeFunctions& shape)>;

/// Every function of it throws InputError for a node that the body does not have and for a field or forces of another
/// size than it asks for. An object is for one thread at a time; different objects are independent of each other.
class Discretisation {
 public:
  virtual ~Discretisation() = default;
  [[nodiscard]] virtual Method method() const = 0;
  [[nodiscard]] virtual const Problem& problem() const = 0;
  [[nodiscard]] virtual const AssemblyReport& report() const = 0;

  /// Solution under the loads and prescribed displacements, no tool. Throws NumericalError with residual and condition.
  [[nodiscard]] virtual Field solve() const = 0;

  /// Response to unit forces (N) on nodes: field k = 3 c + a is the solution under a unit force along axis a on node
  /// candidates[c], with homogeneous loads and prescribed displacements.
  [[nodiscard]] virtual std::vector<Field> force_responses(const std::vector<int>& candidates) const = 0;

  /// Response to every case of forces (N) on nodes: a column of `forces` is a case, with three rows a node.
  [[nodiscard]] virtual std::vector<Field> case_responses(const std::vector<int>& nodes, const MatrixX& forces) const;

  /// What the same cases do to each other and to nodes `at`, with the fields only where they come with it.
  [[nodiscard]] virtual CaseResponses condense_cases(const std::vector<int>& nodes, const MatrixX& forces,
                                                     const std::vector<int>& at) const;

  /// Response to all these forces (N) on nodes together.
  [[nodiscard]] Field force_response(const std::vector<int>& nodes, const std::vector<Vector3>& forces) const;

  /// Displacements of the candidates (3 each, rows) under unit forces on them (columns), m/N: those of
  /// contact_displacements under force_responses, without the fields where the method knows them otherwise.
  [[nodiscard]] virtual MatrixX contact_compliance(const std::vector<int>& candidates) const;
  /// The same of nodes `at` (rows) under unit forces on nodes `forced` (columns).
  [[nodiscard]] virtual MatrixX compliance_between(const std::vector<int>& at, const std::vector<int>& forced) const;

  /// Response to every pattern at amplitude 1, with homogeneous loads and prescribed displacements. Throws InputError
  /// where the method has no forces in newtons (`published`) and NumericalError at a point without a sound support.
  [[nodiscard]] virtual std::vector<Field> pattern_responses(const std::vector<ForcePattern>& patterns) const;
  /// Displacement conjugate to every pattern, rows, under every field, columns, N m. Throws as pattern_responses.
  [[nodiscard]] virtual MatrixX pattern_displacements(const std::vector<ForcePattern>& patterns,
                                                      const std::vector<Field>& fields) const;

  /// Response to prescribed displacements `values` (one per entry of problem().prescribed), with zero loads.
  [[nodiscard]] virtual Field prescribed_response(const std::vector<Vector3>& values) const = 0;

  /// Where the displacement of each prescribed entry acts: its node, or the centroid of its share of the surface.
  [[nodiscard]] virtual std::vector<Vector3> constraint_points() const = 0;

  /// Where a unit force on a surface node acts, and the displacement conjugate to it: the node's own in `published` and
  /// `collocation`, the mean over its share of the surface in `galerkin`.
  [[nodiscard]] virtual Vector3 contact_point(int node) const = 0;
  /// Column k of the result holds the displacements (3 per node, m) under fields[k].
  [[nodiscard]] virtual MatrixX contact_displacements(const std::vector<int>& nodes,
                                                      const std::vector<Field>& fields) const = 0;
  [[nodiscard]] Vector3 contact_displacement(int node, const Field& field) const {
    return contact_displacements({node}, {field}).col(0);
  }

  /// Displacement of every node, u_h(x_i), 3N.
  [[nodiscard]] virtual VectorX nodal_displacements(const Field& field) const = 0;

  /// Everything at a point of the body. Throws InputError when no support covers x.
  [[nodiscard]] virtual PointState at(const Vector3& x, const Field& field) const = 0;

  /// How many nodes have spheres: the first of them, all but where a cut only appends (SightRule::appended).
  [[nodiscard]] virtual int sphere_count() const { return problem().nodes.size(); }
  /// Number of coefficients of a field: 3 a node with a sphere, then 3 for every function that a cut has appended.
  [[nodiscard]] virtual int coefficient_count() const { return 3 * sphere_count(); }
  /// Shape functions at a point of the body by node or appended function: the displacement there is the sum of value_j
  /// times coefficient_j of a field, and of the vector terms. Throws InputError when no support covers x, or where the
  /// method has no spheres.
  virtual void shape_at(const Vector3& x, ShapeFunctions& shape) const;
  /// Calls visit for the points in a region, of those that is_wanted(x) takes, at which the method integrates its weak
  /// form; none where it has no weak form. Near incompressibility the weak form keeps the change of volume small at
  /// these points, and at no others.
  virtual void visit_weak_points(const BoundingBox& region, const std::function<bool(const Vector3& x)>& is_wanted,
                                 const PointVisitor& visit) const;
  /// Radius of a node's sphere, m.
  [[nodiscard]] virtual double sphere_radius(int node) const;

  /// Work that the loads of the problem, all of them at the field's load factor, do on the displacements of a field, J:
  /// initial strain counts as the load that it stands for. Throws InputError where the method has no forces in newtons
  /// (`published`).
  [[nodiscard]] virtual double load_work(const Field& field) const;

  /// Force that the constraint of each prescribed entry exerts on the body, N.
  [[nodiscard]] virtual std::vector<Vector3> constraint_forces(const Field& field) const = 0;

  /// Largest unbalanced force of any unconstrained row under the field's loads and the given nodal forces, relative to
  /// the largest force in the system; of a mixed form also what continuity misses, taken as a force mu / h per m3.
  [[nodiscard]] virtual double residual(const Field& field, const std::vector<int>& loaded_nodes = {},
                                        const std::vector<Vector3>& nodal_forces = {}) const = 0;

 protected:
  void require_nodes(const std::vector<int>& nodes) const;
  void require_cases(const std::vector<int>& nodes, const MatrixX& forces) const;
  void require_loads(const std::vector<int>& nodes, const std::vector<Vector3>& forces) const;
  void require_own(const Field& field) const;
  void require_own(const std::vector<Field>& fields) const;
};

/// Assembles and factors. Throws InputError for an unusable problem (nothing prescribed, bad material, too few nodes)
/// and for options out of their range,
/// NumericalError naming the node whose support never becomes sound or for a singular system.
std::unique_ptr<Discretisation> discretise(Problem problem, const DiscretisationOptions& options);

} // namespace spherecut::solvers
