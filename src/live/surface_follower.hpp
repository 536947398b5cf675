// The surface of a session as it deforms: the shape functions of every vertex are kept, so that a picture is a sum over
// nodes, and only what a cut or new nodes have touched is evaluated anew.
#pragma once

#include "src/session/session.hpp"

namespace spherecut::app {

/// What stays the same from picture to picture.
struct ViewerTopology {
  std::uint32_t number = 0;              // 1, 2, ...
  std::vector<Eigen::Vector3f> vertices; // m, at rest
  std::vector<Triangle> triangles;
  enum class Tag : std::uint8_t { surface, lip, wall, front };
  std::vector<Tag> tags;                     // per vertex
  std::vector<topology::WoundPart> parts;    // per triangle
  std::vector<std::uint16_t> pieces;         // per triangle
  std::vector<std::array<int, 2>> lip_pairs; // vertices on the + and the - side
  std::vector<double> volumes;               // m3, per piece
};

class SurfaceFollower {
 public:
  /// Takes over surface and body of the last step. Deterministic: the same as a new follower would find.
  void follow(const Session& session);

  /// Of the surface; the same object while its triangles stay.
  [[nodiscard]] const std::shared_ptr<const ViewerTopology>& topology() const { return topology_; }

  /// Deformed vertices in the last solution of the session that was followed, m.
  void deform(const Session& session, std::vector<Eigen::Vector3f>& vertices) const;

  /// Values of nodes carried to the vertices by the shape functions.
  void spread(const std::vector<double>& nodal, std::vector<float>& values) const;

  /// Vertices whose shape functions the last follow() evaluated.
  [[nodiscard]] int evaluated() const { return evaluated_; }

 private:
  struct Row {
    int first = 0, count = 0;      // in Rows::nodes and Rows::weights
    int first_term = 0, terms = 0; // in Rows::terms
    double radius = 0;             // m, farthest that a change of the cut matters
  };
  /// What an appended function does to a vertex: displacement of its three unknowns.
  struct Term {
    int group;
    Matrix3 value;
  };
  struct Rows {
    std::vector<Row> rows; // one a vertex; none before there is a body
    std::vector<int> nodes;
    std::vector<double> weights;
    std::vector<Term> terms; // of a body whose cut only appends
  };
  static void add_row(const solvers::ShapeFunctions& shape, const std::vector<double>& radii, Row& row, Rows& into);
  void take_surface(const Session& session);
  void take_rows(const Session& session);

  std::shared_ptr<const ViewerTopology> topology_;
  std::vector<Vector3> places_, evaluation_; // m, at rest
  Rows rows_;
  // The body that rows_ are of:
  std::shared_ptr<const topology::Incision> kept_incision_;
  std::vector<Vector3> node_places_;
  std::vector<double> node_radii_;
  std::vector<Vector3> row_places_; // evaluation points that rows_ belong to
  int evaluated_ = 0;
};

} // namespace spherecut::app
