#include "experiments/remeshing_ledger/volume_mesher.hpp"

#include "topology/base/errors.hpp"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Labeled_mesh_domain_3.h>
#include <CGAL/Mesh_complex_3_in_triangulation_3.h>
#include <CGAL/Mesh_criteria_3.h>
#include <CGAL/Mesh_domain_with_polyline_features_3.h>
#include <CGAL/Mesh_triangulation_3.h>
#include <CGAL/Random.h>
#include <CGAL/make_mesh_3.h>
#include <unordered_map>

namespace spherecut::experiments::ledger {

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using MeshDomain = CGAL::Mesh_domain_with_polyline_features_3<CGAL::Labeled_mesh_domain_3<Kernel>>;
using Triangulation = CGAL::Mesh_triangulation_3<MeshDomain>::type;
using Complex =
    CGAL::Mesh_complex_3_in_triangulation_3<Triangulation, MeshDomain::Corner_index, MeshDomain::Curve_index>;
using Criteria = CGAL::Mesh_criteria_3<Triangulation>;

template <typename Point>
Vector3 vector(const Point& p) {
  return {p.x(), p.y(), p.z()};
}

struct SizeField {
  using FT = double;
  using Point_3 = Kernel::Point_3;
  using Index = MeshDomain::Index;
  const std::function<double(const Vector3&)>* size;
  double factor;
  template <typename Point>
  double operator()(const Point& p, int, const Index&) const {
    return factor * (*size)(vector(p));
  }
};

} // namespace

TetMesh mesh_volume(const MeshRequest& request) {
  namespace params = CGAL::parameters;
  CGAL::Random random(1);
  const auto label = [&request](const Kernel::Point_3& p) { return request.label(vector(p)); };
  const Kernel::Point_3 centre(request.centre.x(), request.centre.y(), request.centre.z());
  MeshDomain domain(std::function<int(const Kernel::Point_3&)>(label),
                    Kernel::Sphere_3(centre, request.radius * request.radius), params::relative_error_bound = 1e-6,
                    params::p_rng = &random);
  std::vector<std::vector<Kernel::Point_3>> features;
  for (const auto& polyline : request.features) {
    features.emplace_back();
    for (const Vector3& x : polyline)
      features.back().emplace_back(x.x(), x.y(), x.z());
  }
  domain.add_features(features.begin(), features.end());
  // Edges of faces and cells come out somewhat shorter than these bounds allow on average.
  const Criteria criteria(params::edge_size = SizeField{&request.size, 1.0}, params::facet_angle = 25,
                          params::facet_size = SizeField{&request.size, 0.7}, params::facet_distance = request.distance,
                          params::cell_radius_edge_ratio = 2.2, params::cell_size = SizeField{&request.size, 0.75});
  const Complex complex = CGAL::make_mesh_3<Complex>(domain, criteria, params::no_perturb(), params::no_exude());
  TetMesh mesh;
  std::unordered_map<const void*, int> index;
  for (auto cell = complex.cells_in_complex_begin(); cell != complex.cells_in_complex_end(); ++cell) {
    std::array<int, 4> tet;
    for (int k = 0; k < 4; ++k) {
      const auto vertex = cell->vertex(k);
      const auto [entry, fresh] = index.try_emplace(&*vertex, static_cast<int>(mesh.vertices.size()));
      if (fresh)
        mesh.vertices.push_back(vector(vertex->point()));
      tet[k] = entry->second;
    }
    if (six_volumes(mesh.vertices[tet[0]], mesh.vertices[tet[1]], mesh.vertices[tet[2]], mesh.vertices[tet[3]]) < 0)
      std::swap(tet[2], tet[3]);
    mesh.tets.push_back(tet);
  }
  if (mesh.tets.empty())
    throw NumericalError("Mesh_3 gave no tetrahedra");
  return mesh;
}

} // namespace spherecut::experiments::ledger
