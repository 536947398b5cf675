// A body whose cut grows increment by increment, in the weak form: instead of assembling and factoring anew, the parts
// of the system near the increment are exchanged and a dense window of it is factored again (schur_window.hpp).
//
// The nodes far from the cut's way are eliminated once. The window holds every node that a cut along the predicted way
// can touch: all nodes of the cells within one sphere radius of it (hidden and bent sight lines) or within reach of the
// enrichment of its front. An increment evaluates the touched cells again, S += K_new - K_old, factors S and condenses
// it to the contact.
#pragma once

#include "solvers/body/surface_patches.hpp"

#include <memory>

namespace spherecut::solvers {

/// Ids stay what they are: removed nodes keep their place without a sphere, added ones come at the end.
struct NodeChange {
  std::vector<int> removed;
  NodeCloud added;
  /// Held nodes and loads after the change (ids of added nodes count on from those there were); empty: as before. Body
  /// force and initial strain stay what they are.
  std::optional<std::vector<Prescribed>> prescribed{};
  std::optional<Loads> loads{};
};

struct GrowthOptions {
  DiscretisationOptions method; // galerkin
  /// Where the faces of the cut may come to lie in the next increments (rest frame): the predicted way of the blade,
  /// from its first triangle on. A cut that leaves it is handled all the same, by condensing anew along `way`.
  topology::SurfaceMesh way;
  std::vector<int> contact; // candidates of the tool: free surface nodes
  int room = 200;           // nodes that may be added before the window is condensed anew
};

/// About which part of the nodes the window along a way would hold, from 0 to 1. Where it is most of them the window's
/// dense system costs more than it saves.
double window_share(const Problem& problem, const DiscretisationOptions& method, const topology::SurfaceMesh& way);

/// What one increment took. Seconds are wall clock.
struct GrowthReport {
  bool condensed_anew = false;
  bool declined = false;   // it was to be an update alone and cannot be one; all is as it was
  const char* reason = ""; // why it had to be, or cannot
  int boxes = 0;           // background boxes exchanged; rows of cells made again (collocation)
  int window_nodes = 0;    // nodes in the dense system
  bool prepared = false;   // all that was eliminated ahead could stay
  int factored = 0;        // unknowns of the dense system factored in the increment itself
  double spheres_seconds = 0, cells_seconds = 0, factor_seconds = 0, condense_seconds = 0, total_seconds = 0;
};

class GrowingCut {
 public:
  /// Assembles and condenses. Throws InputError when the method is not galerkin, a candidate does not exist or the way
  /// is empty, else as discretise() does.
  GrowingCut(Problem problem, GrowthOptions options);
  ~GrowingCut();
  GrowingCut(const GrowingCut&) = delete;
  GrowingCut& operator=(const GrowingCut&) = delete;

  /// The cut becomes `incision`, whose sheets continue those before it triangle by triangle (as topology::BladeSweep
  /// appends them), and the nodes change with it. Whatever the window does not cover is condensed anew and said. Throws
  /// as the constructor when the new body cannot be solved; the state is then the one before. `way_ahead` is asked for
  /// the predicted way when the window has to be condensed anew; null: it stays what it was. With `only_update` it is
  /// declined instead where the window is seen not to cover it.
  GrowthReport grow(const NodeChange& change, const std::shared_ptr<const topology::Incision>& incision,
                    const std::function<topology::SurfaceMesh()>& way_ahead = {}, bool only_update = false);

  /// Work ahead of the next increment, where it is known: finds which unknowns it will change and eliminates the others
  /// in the window. Returns the seconds it took (those of the background, not of the increment). Another increment than
  /// this one costs what of that it changes, no more than the whole window. Throws as grow() does.
  double prepare(const NodeChange& change, const std::shared_ptr<const topology::Incision>& incision);

  /// The problem as it stands; removed nodes are still in its arrays.
  [[nodiscard]] const Problem& problem() const;
  /// Per node: 1 when it has been removed.
  [[nodiscard]] const std::vector<char>& removed() const;
  [[nodiscard]] int window_unknowns() const;

  /// Displacement of the candidates (3 each, m) per unit force on them, m/N; and under the loads alone.
  [[nodiscard]] const MatrixX& compliance() const;
  [[nodiscard]] const std::vector<int>& candidates() const;
  [[nodiscard]] const VectorX& base_displacement() const;

  /// Nodal coefficients (3N, zero for removed nodes) under the loads and the given forces on the candidates, N.
  [[nodiscard]] VectorX coefficients(const std::vector<Vector3>& contact_forces) const;

  // What a discretisation on top of it asks for (growing_body.hpp). Vectors have 3 entries a node, removed ones
  // included.
  [[nodiscard]] const Spheres& spheres() const;
  /// Per node: 0 where the last increment left the shape functions at it as they were.
  [[nodiscard]] const std::vector<char>& altered() const;
  [[nodiscard]] const std::vector<DisplacementMean>& held() const;         // one per entry of problem().prescribed
  [[nodiscard]] const DisplacementMean& mean(int node) const;              // where a force on this node acts
  [[nodiscard]] const AssemblyReport& report() const;                      // of the last condensation
  [[nodiscard]] bool is_anchored(int node) const;                          // by a spring that holds a severed piece
  [[nodiscard]] const VectorX& external_loads() const;                     // N, prescribed displacements left out
  [[nodiscard]] MatrixX respond(const MatrixX& forces) const;              // coefficients, one column per column
  [[nodiscard]] VectorX elastic_forces(const VectorX& coefficients) const; // N, held means left out
  /// What the columns of `forces` do to each other and to nodes `at`, without the fields
  /// (Discretisation::condense_cases).
  [[nodiscard]] CaseResponses condense_cases(const MatrixX& forces, const std::vector<int>& at) const;

  /// Compliance and coefficients from a system that is assembled and factored from scratch (dense) on the same boxes
  /// and nodes: what the updated ones must equal.
  struct Scratch {
    MatrixX compliance;
    VectorX coefficients;
  };
  [[nodiscard]] Scratch from_scratch(const std::vector<Vector3>& contact_forces) const;

 private:
  struct State;
  class Growth;
  std::unique_ptr<State> state_;
};

} // namespace spherecut::solvers
