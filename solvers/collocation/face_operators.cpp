#include "solvers/collocation/face_operators.hpp"

#include "solvers/shapes/cut_sight.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

namespace {

// The stress grows like r^(-1/2) towards the front: on a face that ends there a single point misses 30 % of its mean.
constexpr double singular_reach = 2; // from the front, in units of the spacing
constexpr int deepest_division = 4;  // of a triangle whose edges are longer than it is away from the front

using FacetCorners = std::array<Vector3, 3>;

Vector3 area_of(const FacetCorners& t) {
  return 0.5 * (t[1] - t[0]).cross(t[2] - t[0]);
}

class FaceMeans {
 public:
  FaceMeans(const topology::CellComplex& cells, const Problem& problem, const Spheres& spheres,
            const NodalSupports& supports)
      : cells_(cells), problem_(problem), incision_(problem.hiding().get()), spheres_(spheres), supports_(supports),
        enriched_(spheres.cut() != nullptr && spheres.cut()->sight().rule == SightRule::enriched),
        place_(problem.nodes.size(), -1) {
    const std::size_t faces = cells.faces.size();
    const std::size_t entries =
        faces * (supports.nodes.size() / std::max<std::size_t>(1, supports.start.size() - 1) + 4);
    result_.start.reserve(faces + 1);
    result_.at_front.reserve(faces);
    result_.nodes.reserve(entries);
    result_.value.reserve(entries);
    result_.gradient.reserve(entries);
  }

  void add_face(int f) {
    const topology::CellFace& face = cells_.faces[f];
    const double spacing = problem_.nodes.spacings[face.first];
    if (enriched_ && incision_->front_frame(face.centroid, singular_reach * spacing)) {
      const int begin = cells_.face_start[f], end = cells_.face_start[f + 1];
      const auto triangle = [&](int k) {
        return FacetCorners{face.centroid, cells_.face_corners[k], cells_.face_corners[k + 1 < end ? k + 1 : begin]};
      };
      Vector3 area = Vector3::Zero();
      for (int k = begin; k < end; ++k)
        area += area_of(triangle(k));
      for (int k = begin; k < end; ++k)
        add_triangle(face, triangle(k), area / area.squaredNorm(), 0);
    } else if (!is_hidden(face, face.centroid)) {
      add_support(face, face.centroid);
    } else {
      add_point(face, face.centroid, 1);
    }
    result_.at_front.push_back(enriched_ && spheres_.cut()->enriches(face.centroid) ? 1 : 0);
    for (std::size_t k = result_.start.back(); k < result_.nodes.size(); ++k)
      place_[result_.nodes[k]] = -1;
    result_.start.push_back(static_cast<int>(result_.nodes.size()));
  }
  FaceOperators take() { return std::move(result_); }

 private:
  void add_triangle(const topology::CellFace& face, const FacetCorners& t, const Vector3& share_of_area, int depth) {
    const Vector3 middle = (t[0] + t[1] + t[2]) / 3;
    const double longest = std::max({(t[1] - t[0]).norm(), (t[2] - t[1]).norm(), (t[0] - t[2]).norm()});
    if (depth < deepest_division && incision_->front_frame(middle, longest)) {
      const Vector3 a = 0.5 * (t[0] + t[1]), b = 0.5 * (t[1] + t[2]), c = 0.5 * (t[2] + t[0]);
      for (const FacetCorners& part :
           {FacetCorners{t[0], a, c}, FacetCorners{a, t[1], b}, FacetCorners{c, b, t[2]}, FacetCorners{a, b, c}})
        add_triangle(face, part, share_of_area, depth + 1);
      return;
    }
    add_point(face, middle, share_of_area.dot(area_of(t)));
  }

  void add_point(const topology::CellFace& face, const Vector3& x, double share) {
    if (is_hidden(face, x)) {
      // Behind the sheet: the mean of what the two nodes see stays on their side.
      for (const int node : {face.first, face.second}) {
        const Vector3 way = x - problem_.nodes.positions[node];
        for (int k = supports_.start[node]; k < supports_.start[node + 1]; ++k)
          add(supports_.nodes[k], 0.5 * share * (supports_.value[k] + supports_.gradient[k].dot(way)),
              0.5 * share * supports_.gradient[k]);
      }
      return;
    }
    evaluate_at(face, x);
    for (int k = 0; k < shape_.size(); ++k)
      add(shape_.nodes[k], share * shape_.value[k], share * shape_.gradient(k));
  }

  void evaluate_at(const topology::CellFace& face, const Vector3& x) {
    if (!evaluate(spheres_, x, shape_))
      throw NumericalError(
          fmt::format("the face between nodes {} and {} has {} supporting nodes: the nodes leave a hole there",
                      face.first, face.second, shape_.size()));
  }

  /// A face of one point: its support as it is.
  void add_support(const topology::CellFace& face, const Vector3& x) {
    evaluate_at(face, x);
    result_.nodes.insert(result_.nodes.end(), shape_.nodes.begin(), shape_.nodes.end());
    result_.value.insert(result_.value.end(), shape_.value.begin(), shape_.value.end());
    for (int k = 0; k < shape_.size(); ++k)
      result_.gradient.push_back(shape_.gradient(k));
  }

  [[nodiscard]] bool is_hidden(const topology::CellFace& face, const Vector3& x) const {
    if (incision_ == nullptr)
      return false;
    const Vector3 &a = problem_.nodes.positions[face.first], &b = problem_.nodes.positions[face.second];
    return incision_->near(x, std::max((x - a).norm(), (x - b).norm())) &&
           (incision_->blocks(a, x) || incision_->blocks(b, x));
  }

  void add(int node, double value, const Vector3& gradient) {
    int& place = place_[node];
    if (place < 0) {
      place = static_cast<int>(result_.nodes.size());
      result_.nodes.push_back(node);
      result_.value.push_back(0);
      result_.gradient.emplace_back(Vector3::Zero());
    }
    result_.value[place] += value;
    result_.gradient[place] += gradient;
  }

  const topology::CellComplex& cells_;
  const Problem& problem_;
  const topology::Incision* incision_;
  const Spheres& spheres_;
  const NodalSupports& supports_;
  bool enriched_;
  std::vector<int> place_; // of a node in the row of the face at hand, -1: none
  ShapeFunctions shape_;
  FaceOperators result_;
};

} // namespace

FaceOperators face_operators(const topology::CellComplex& cells, const Problem& problem, const Spheres& spheres,
                             const NodalSupports& supports) {
  FaceMeans means(cells, problem, spheres, supports);
  for (int f = 0; f < std::ssize(cells.faces); ++f)
    means.add_face(f);
  return means.take();
}

} // namespace spherecut::solvers
