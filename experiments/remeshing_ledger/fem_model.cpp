// Key: L barycentric coordinates, G_a gradient of node a, M_ab = integral of G_a G_b^T; the block of nodes (a, b) is
// lambda M + mu M^T + mu tr(M) 1.
#include "experiments/remeshing_ledger/fem_model.hpp"

#include "solvers/algebra/elimination_order.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <unordered_map>

namespace spherecut::experiments::ledger {

namespace {

constexpr std::array<std::array<int, 2>, 6> edge_of{{{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}}};

struct TetPoint {
  std::array<double, 4> l;
  double weight; // of unit volume
};

/// Four points, exact to degree 2.
const std::vector<TetPoint>& four_points() {
  static const std::vector<TetPoint> rule = [] {
    constexpr double a = 0.5854101966249685, b = 0.1381966011250105;
    std::vector<TetPoint> points;
    for (int k = 0; k < 4; ++k) {
      TetPoint p{{b, b, b, b}, 0.25};
      p.l[static_cast<std::size_t>(k)] = a;
      points.push_back(p);
    }
    return points;
  }();
  return rule;
}

struct TrianglePoint {
  std::array<double, 3> l;
  double weight; // of unit area
};

/// Six points, exact to degree 4 [Dunavant 1985].
const std::vector<TrianglePoint>& six_points() {
  static const std::vector<TrianglePoint> rule = [] {
    std::vector<TrianglePoint> points;
    for (const auto& [a, w] :
         {std::pair{0.445948490915965, 0.223381589678011}, std::pair{0.091576213509771, 0.109951743655322}})
      for (int k = 0; k < 3; ++k) {
        TrianglePoint p{{a, a, a}, w};
        p.l[static_cast<std::size_t>(k)] = 1 - 2 * a;
        points.push_back(p);
      }
    return points;
  }();
  return rule;
}

std::array<double, 6> face_shapes(bool quadratic, const std::array<double, 3>& l) {
  if (!quadratic)
    return {l[0], l[1], l[2], 0, 0, 0};
  return {l[0] * (2 * l[0] - 1), l[1] * (2 * l[1] - 1), l[2] * (2 * l[2] - 1),
          4 * l[0] * l[1],       4 * l[1] * l[2],       4 * l[0] * l[2]};
}

/// Place and area element of the mapped face.
struct FacePlace {
  Vector3 position;
  double area; // per unit of the weights
};
FacePlace face_place(const FemNodes& nodes, const std::array<int, 6>& face, const std::array<double, 3>& l) {
  const auto x = [&](int k) -> const Vector3& { return nodes.positions[face[k]]; };
  if (nodes.element == Element::linear)
    return {l[0] * x(0) + l[1] * x(1) + l[2] * x(2), 0.5 * (x(1) - x(0)).cross(x(2) - x(0)).norm()};
  const std::array<double, 6> n = face_shapes(true, l);
  const double d1[6] = {-(4 * l[0] - 1), 4 * l[1] - 1, 0, 4 * (l[0] - l[1]), 4 * l[2], -4 * l[2]};
  const double d2[6] = {-(4 * l[0] - 1), 0, 4 * l[2] - 1, -4 * l[1], 4 * l[1], 4 * (l[0] - l[2])};
  Vector3 position = Vector3::Zero(), t1 = position, t2 = position;
  for (int k = 0; k < 6; ++k) {
    position += n[k] * x(k);
    t1 += d1[k] * x(k);
    t2 += d2[k] * x(k);
  }
  return {position, 0.5 * t1.cross(t2).norm()};
}

} // namespace

FemNodes number_nodes(const CutMesh& mesh, const Scenario& scenario, Element element) {
  FemNodes nodes;
  nodes.element = element;
  nodes.positions = mesh.vertices;
  nodes.elements.resize(mesh.tets.size());
  nodes.tip.assign(mesh.tets.size(), 0);
  std::unordered_map<std::uint64_t, int> on_edge;
  if (element != Element::linear) {
    nodes.positions.reserve(8 * mesh.vertices.size());
    on_edge.reserve(8 * mesh.vertices.size());
  }
  const auto key = [](int a, int b) {
    return (static_cast<std::uint64_t>(static_cast<std::uint32_t>(std::min(a, b))) << 32) |
           static_cast<std::uint32_t>(std::max(a, b));
  };
  for (std::size_t e = 0; e < mesh.tets.size(); ++e) {
    const auto& t = mesh.tets[e];
    std::copy(t.begin(), t.end(), nodes.elements[e].begin());
    for (int v : t)
      nodes.tip[e] = nodes.tip[e] != 0 || mesh.front[v] != 0 ? 1 : 0;
    if (element == Element::linear)
      continue;
    for (int k = 0; k < 6; ++k) {
      const int a = t[edge_of[k][0]], b = t[edge_of[k][1]];
      const auto [entry, fresh] = on_edge.try_emplace(key(a, b), static_cast<int>(nodes.positions.size()));
      if (fresh) {
        double share = 0.5;
        if (element == Element::quarter_point && mesh.front[a] != mesh.front[b])
          share = mesh.front[a] != 0 ? 0.25 : 0.75;
        nodes.positions.emplace_back((1 - share) * mesh.vertices[a] + share * mesh.vertices[b]);
        nodes.edges.push_back({a, b, share});
      }
      nodes.elements[e][4 + k] = entry->second;
    }
  }
  const auto six = [&](const std::array<int, 3>& c) {
    std::array<int, 6> all{c[0], c[1], c[2], -1, -1, -1};
    if (element != Element::linear)
      for (int k = 0; k < 3; ++k)
        all[3 + k] = on_edge.at(key(c[edge_of[k][0]], c[edge_of[k][1]]));
    return all;
  };
  for (const CutMesh::Face& face : mesh.faces)
    nodes.faces.push_back({six(face.above), six(face.below)});
  nodes.held.assign(nodes.positions.size(), 0);
  nodes.prescribed.assign(nodes.positions.size(), Vector3::Zero());
  for (const Triangle& t : mesh.surface) {
    const Vector3 normal =
        (mesh.vertices[t[1]] - mesh.vertices[t[0]]).cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]).normalized();
    const Vector3 centre = (mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]]) / 3;
    if (!scenario.held(centre, normal))
      continue;
    for (int v : six({t[0], t[1], t[2]}))
      if (v >= 0 && nodes.held[v] == 0) {
        nodes.held[v] = 1;
        nodes.prescribed[v] = scenario.displacement(nodes.positions[v]);
      }
  }
  return nodes;
}

void FemNodes::place_edges() {
  const auto first = static_cast<std::size_t>(corners());
  for (std::size_t i = 0; i < edges.size(); ++i)
    positions[first + i] = (1 - edges[i].share) * positions[edges[i].from] + edges[i].share * positions[edges[i].to];
}

bool element_stiffness(const FemNodes& nodes, int element, const solvers::Material& material, MatrixX& stiffness) {
  const auto& e = nodes.elements[element];
  const int n = nodes.per_element();
  Matrix3 edges;
  for (int k = 0; k < 3; ++k)
    edges.col(k) = nodes.positions[e[k + 1]] - nodes.positions[e[0]];
  const double volume = edges.determinant() / 6;
  Eigen::Matrix<double, 3, 4> flat; // gradients of L
  flat.rightCols<3>() = edges.inverse().transpose();
  flat.col(0) = -flat.rightCols<3>().rowwise().sum();
  const double lambda = material.lame_lambda(), mu = material.shear_modulus();
  bool sound = volume > 0;
  Eigen::Matrix<double, 3, 10> g;
  double sum[3][3][100];
  for (auto& row : sum)
    for (auto& entry : row)
      std::fill(entry, entry + n * n, 0.0);
  const bool curved = nodes.element == Element::quarter_point && nodes.tip[element] != 0;
  const std::size_t points = nodes.element == Element::linear ? 1 : 4;
  for (std::size_t q = 0; q < points; ++q) {
    double weight = volume;
    if (nodes.element == Element::linear) {
      g.leftCols<4>() = flat;
    } else {
      const TetPoint& p = four_points()[q];
      weight *= p.weight;
      for (int k = 0; k < 4; ++k)
        g.col(k) = (4 * p.l[k] - 1) * flat.col(k);
      for (int k = 0; k < 6; ++k)
        g.col(4 + k) =
            4 * (p.l[edge_of[k][0]] * flat.col(edge_of[k][1]) + p.l[edge_of[k][1]] * flat.col(edge_of[k][0]));
      if (curved) { // from the straight element to the mapped one
        Matrix3 map = Matrix3::Zero();
        for (int k = 0; k < 10; ++k)
          map += nodes.positions[e[k]] * g.col(k).transpose();
        const double stretch = map.determinant();
        if (stretch <= 1e-6) {
          sound = false;
          continue;
        }
        weight *= stretch;
        g = (map.inverse().transpose() * g).eval();
      }
    }
    for (int x = 0; x < 3; ++x)
      for (int y = 0; y < 3; ++y)
        for (int a = 0; a < n; ++a) {
          const double ga = weight * g(x, a);
          for (int b = 0; b < n; ++b)
            sum[x][y][a * n + b] += ga * g(y, b);
        }
  }
  stiffness.resize(3 * n, 3 * n);
  for (int a = 0; a < n; ++a)
    for (int b = 0; b < n; ++b) {
      const int k = a * n + b;
      const double trace = mu * (sum[0][0][k] + sum[1][1][k] + sum[2][2][k]);
      for (int x = 0; x < 3; ++x)
        for (int y = 0; y < 3; ++y)
          stiffness(3 * a + x, 3 * b + y) = lambda * sum[x][y][k] + mu * sum[y][x][k] + (x == y ? trace : 0);
    }
  return sound;
}

VectorX face_loads(const FemNodes& nodes, const Scenario& scenario) {
  VectorX loads = VectorX::Zero(3 * static_cast<Eigen::Index>(nodes.positions.size()));
  if (scenario.pressure == 0)
    return loads;
  const bool quadratic = nodes.element != Element::linear;
  for (const auto& face : nodes.faces)
    for (const TrianglePoint& p : six_points()) {
      const double area = p.weight * face_place(nodes, face.above, p.l).area;
      const std::array<double, 6> n = face_shapes(quadratic, p.l);
      for (int k = 0; k < (quadratic ? 6 : 3); ++k) {
        const Vector3 force = scenario.pressure * area * n[k] * scenario.frame.normal;
        loads.segment<3>(3 * static_cast<Eigen::Index>(face.above[k])) += force;
        loads.segment<3>(3 * static_cast<Eigen::Index>(face.below[k])) -= force;
      }
    }
  return loads;
}

Opening fem_opening(const FemNodes& nodes, const Scenario& scenario, const VectorX& displacement) {
  Opening opening;
  opening.volume = 0;
  const bool quadratic = nodes.element != Element::linear;
  const auto jump = [&](const FemNodes::FaceNodes& face, const std::array<double, 3>& l) {
    const std::array<double, 6> n = face_shapes(quadratic, l);
    double sum = 0;
    for (int k = 0; k < (quadratic ? 6 : 3); ++k)
      sum += n[k] * scenario.frame.normal.dot(displacement.segment<3>(3 * static_cast<Eigen::Index>(face.above[k])) -
                                              displacement.segment<3>(3 * static_cast<Eigen::Index>(face.below[k])));
    return sum;
  };
  const Vector2 marked = scenario.in_plane(scenario.marked);
  double nearest = std::numeric_limits<double>::infinity(), error = 0, size = 0;
  for (const auto& face : nodes.faces) {
    for (const TrianglePoint& p : six_points()) {
      const FacePlace place = face_place(nodes, face.above, p.l);
      const double area = p.weight * place.area, found = jump(face, p.l);
      opening.volume += area * found;
      if (scenario.exact_opening) {
        const double wanted = scenario.exact_opening(place.position);
        error += area * (found - wanted) * (found - wanted);
        size += area * wanted * wanted;
      }
    }
    const Vector2 a = scenario.in_plane(nodes.positions[face.above[0]]),
                  b = scenario.in_plane(nodes.positions[face.above[1]]),
                  c = scenario.in_plane(nodes.positions[face.above[2]]);
    Eigen::Matrix2d m;
    m << b - a, c - a;
    const Vector2 s = m.inverse() * (marked - a);
    const double outside = std::max({-s.x(), -s.y(), s.x() + s.y() - 1, 0.0});
    if (outside < nearest) {
      nearest = outside;
      opening.marked = jump(face, {1 - s.x() - s.y(), s.x(), s.y()});
    }
  }
  if (scenario.exact_opening)
    opening.profile_error = std::sqrt(error / size);
  if (scenario.force_direction.isZero(0))
    return opening;
  opening.force = 0;
  MatrixX stiffness;
  const int n = nodes.per_element();
  for (int e = 0; e < std::ssize(nodes.elements); ++e) {
    const auto& element = nodes.elements[e];
    const auto is_tool = [&](int node) { return nodes.held[node] != 0 && scenario.tool(nodes.positions[node]); };
    if (std::none_of(element.begin(), element.begin() + n, is_tool))
      continue;
    element_stiffness(nodes, e, scenario.material, stiffness);
    VectorX u(3 * n);
    for (int k = 0; k < n; ++k)
      u.segment<3>(3 * k) = displacement.segment<3>(3 * static_cast<Eigen::Index>(element[k]));
    const VectorX force = stiffness * u;
    for (int k = 0; k < n; ++k)
      if (is_tool(element[k]))
        opening.force += scenario.force_direction.dot(force.segment<3>(3 * k));
  }
  return opening;
}

std::vector<int> elimination_places(const FemNodes& nodes, int& unknown_nodes, const std::vector<char>& left_out) {
  const int n = nodes.per_element();
  std::vector<int> number(nodes.positions.size(), -1);
  unknown_nodes = 0;
  std::vector<char> used(nodes.positions.size(), 0);
  for (const auto& e : nodes.elements)
    for (int k = 0; k < n; ++k)
      used[e[k]] = 1;
  for (std::size_t i = 0; i < number.size(); ++i)
    if (used[i] != 0 && nodes.held[i] == 0 && (left_out.empty() || left_out[i] == 0))
      number[i] = unknown_nodes++;
  if (unknown_nodes == 0)
    return number;
  std::vector<std::vector<int>> beside(static_cast<std::size_t>(unknown_nodes));
  for (const auto& e : nodes.elements)
    for (int a = 0; a < n; ++a)
      if (number[e[a]] >= 0)
        for (int b = 0; b < n; ++b)
          if (number[e[b]] >= 0 && number[e[b]] != number[e[a]])
            beside[number[e[a]]].push_back(number[e[b]]);
  std::vector<int> start{0}, neighbours;
  for (auto& row : beside) {
    std::sort(row.begin(), row.end());
    row.erase(std::unique(row.begin(), row.end()), row.end());
    neighbours.insert(neighbours.end(), row.begin(), row.end());
    start.push_back(static_cast<int>(neighbours.size()));
  }
  const std::vector<int> order = solvers::fill_reducing_ordering(start, neighbours);
  std::vector<int> place(order.size());
  for (int k = 0; k < std::ssize(order); ++k)
    place[order[k]] = k;
  for (int& i : number)
    if (i >= 0)
      i = place[i];
  return number;
}

FemSystem assemble(const FemNodes& nodes, const solvers::Material& material, const std::vector<int>& place,
                   int unknown_nodes, const std::vector<char>& which) {
  const int n = nodes.per_element();
  const auto counts = [&](std::size_t e) { return which.empty() || which[e] != 0; };
  // Pattern of node blocks, lower triangle by columns; every block but the diagonal one is full.
  std::vector<std::vector<int>> below(static_cast<std::size_t>(unknown_nodes));
  for (std::size_t i = 0; i < nodes.elements.size(); ++i) {
    if (!counts(i))
      continue;
    const auto& e = nodes.elements[i];
    for (int a = 0; a < n; ++a)
      if (const int column = place[e[a]]; column >= 0)
        for (int b = 0; b < n; ++b)
          if (place[e[b]] > column)
            below[column].push_back(place[e[b]]);
  }
  FemSystem system;
  const Eigen::Index size = 3 * static_cast<Eigen::Index>(unknown_nodes);
  system.right = VectorX::Zero(size);
  std::vector<Eigen::Index> first(static_cast<std::size_t>(unknown_nodes) + 1, 0);
  for (int j = 0; j < unknown_nodes; ++j) {
    auto& rows = below[j];
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    first[j + 1] = first[j] + 6 + 9 * std::ssize(rows);
  }
  system.lower.resize(size, size);
  system.lower.resizeNonZeros(first.back());
  int* outer = system.lower.outerIndexPtr();
  int* inner = system.lower.innerIndexPtr();
  double* value = system.lower.valuePtr();
  std::fill(value, value + first.back(), 0.0);
  for (int j = 0; j < unknown_nodes; ++j) {
    const auto& rows = below[j];
    Eigen::Index at = first[j];
    for (int c = 0; c < 3; ++c) {
      outer[3 * j + c] = static_cast<int>(at);
      for (int d = c; d < 3; ++d)
        inner[at++] = 3 * j + d;
      for (int i : rows)
        for (int d = 0; d < 3; ++d)
          inner[at++] = 3 * i + d;
    }
  }
  outer[size] = static_cast<int>(first.back());
  MatrixX k;
  for (int e = 0; e < std::ssize(nodes.elements); ++e) {
    if (!counts(static_cast<std::size_t>(e)))
      continue;
    system.folded += element_stiffness(nodes, e, material, k) ? 0 : 1;
    const auto& element = nodes.elements[e];
    for (int b = 0; b < n; ++b) {
      const int j = place[element[b]];
      if (j < 0) {
        if (nodes.held[element[b]] == 0)
          continue;
        const Vector3& u = nodes.prescribed[element[b]];
        for (int a = 0; a < n; ++a)
          if (place[element[a]] >= 0)
            system.right.segment<3>(3 * static_cast<Eigen::Index>(place[element[a]])) -=
                k.block<3, 3>(3 * a, 3 * b) * u;
        continue;
      }
      const auto& rows = below[j];
      const auto height = static_cast<Eigen::Index>(3 * rows.size());
      for (int a = 0; a < n; ++a) {
        const int i = place[element[a]];
        if (i < j)
          continue;
        Eigen::Index at = first[j];
        if (i == j) {
          for (int c = 0; c < 3; ++c, at += height)
            for (int d = c; d < 3; ++d)
              value[at++] += k(3 * a + d, 3 * b + c);
          continue;
        }
        const Eigen::Index row = 3 * (std::lower_bound(rows.begin(), rows.end(), i) - rows.begin());
        for (int c = 0; c < 3; ++c) {
          at += 3 - c; // diagonal part of the column
          for (int d = 0; d < 3; ++d)
            value[at + row + d] += k(3 * a + d, 3 * b + c);
          at += height;
        }
      }
    }
  }
  return system;
}

FemSolution solve_fem(const CutMesh& mesh, const Scenario& scenario, Element element, StageTimes& times) {
  FemSolution solution;
  std::vector<int> place;
  int unknown_nodes = 0;
  {
    const StageClock clock(times, Stage::neighbours);
    solution.nodes = number_nodes(mesh, scenario, element);
  }
  {
    const StageClock clock(times, Stage::factorisation);
    place = elimination_places(solution.nodes, unknown_nodes);
  }
  FemSystem system;
  {
    const StageClock clock(times, Stage::assembly);
    system = assemble(solution.nodes, scenario.material, place, unknown_nodes);
    const VectorX loads = face_loads(solution.nodes, scenario);
    for (std::size_t i = 0; i < place.size(); ++i)
      if (place[i] >= 0)
        system.right.segment<3>(3 * static_cast<Eigen::Index>(place[i])) +=
            loads.segment<3>(3 * static_cast<Eigen::Index>(i));
  }
  {
    const StageClock clock(times, Stage::factorisation);
    solution.factor = solvers::factor_ordered(system.lower);
  }
  const StageClock clock(times, Stage::solve);
  const VectorX x = solution.factor->solve(system.right);
  solution.displacement = VectorX::Zero(3 * static_cast<Eigen::Index>(solution.nodes.positions.size()));
  for (std::size_t i = 0; i < place.size(); ++i)
    solution.displacement.segment<3>(3 * static_cast<Eigen::Index>(i)) =
        place[i] >= 0 ? Vector3(x.segment<3>(3 * static_cast<Eigen::Index>(place[i]))) : solution.nodes.prescribed[i];
  solution.norm = solvers::one_norm(system.lower, true);
  solution.unknowns = 3 * unknown_nodes;
  solution.folded = system.folded;
  return solution;
}

void part_and_solve(const TetMesh& mesh, const Scenario& scenario, Element element, double tolerance,
                    Increment& increment, FemSolution& solution) {
  try {
    CutMesh cut;
    {
      const StageClock clock(increment.times, Stage::meshing);
      cut = part(mesh, scenario, increment.number, tolerance);
    }
    solution = solve_fem(cut, scenario, element, increment.times);
    increment.unknowns = solution.unknowns;
    increment.quality = smallest_quality(cut.vertices, cut.tets);
  } catch (const NumericalError& error) {
    increment.failure = error.what();
  }
}

} // namespace spherecut::experiments::ledger
