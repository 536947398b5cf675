// Extended finite elements: the tetrahedra of the uncut organ stay as they are and do not follow the cut. GetFEM cuts
// the elements that the level sets of sheet and front cross and gives the points of their integrals; nodes behind the
// front get a second displacement, corners near it the functions of its neighbourhood. Elements whose enrichment an
// increment does not touch keep their stiffness, the order of elimination is found once; the system is factored anew.
#include "experiments/remeshing_ledger/mesh_request.hpp"
#include "experiments/remeshing_ledger/own_process.hpp"
#include "experiments/remeshing_ledger/xfem_cells.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments::ledger {

namespace {

constexpr double off_plane = 1e-3; // of the size at the front: no vertex lies nearer to the plane
constexpr int side_order = 2;      // of the integrals of polynomials on one side of the cut
constexpr int front_order = 5;     // of those with front functions

class XFem final : public BackEnd {
 public:
  XFem(const Scenario& scenario, const Resolution& resolution, Element element, double reach, double limit)
      : scenario_(scenario), resolution_(resolution), element_(element), reach_(reach), limit_(limit),
        number_(resolution.first) {}

  std::string name() const override { return fmt::format("xfem_{}", to_string(element_)); }
  bool may_skip() const override { return false; }

  /// The mesh of the uncut organ, fine along the whole way of the front.
  Increment start() override {
    Increment increment;
    increment.anew = true;
    Grading grading{resolution_.fine, resolution_.slope, resolution_.coarse_over_fine * resolution_.fine, {}};
    std::vector<std::vector<Vector3>> fronts;
    const double way = (scenario_.increments - number_) * scenario_.advance;
    const int stations = std::max(1, static_cast<int>(std::ceil(way / resolution_.fine)));
    for (int i = 0; i <= stations; ++i)
      fronts.push_back(front_of(scenario_, number_ + (scenario_.increments - number_) * i / stations).points);
    MeshRequest request = mesh_request(scenario_, number_, grading);
    request.label = [this](const Vector3& x) { return scenario_.contains(x) ? 1 : 0; };
    request.features = scenario_.sharp_edges;
    request.size = [grading, fronts](const Vector3& x) {
      double least = grading.coarse;
      Grading one = grading;
      for (const auto& front : fronts) {
        one.front = front;
        least = std::min(least, one(x));
      }
      return least;
    };
    TetMesh mesh = mesh_for(
        increment, [&] { return mesh_volume(request); }, limit_);
    if (!increment.failure.empty())
      return increment;
    {
      const StageClock clock(increment.times, Stage::meshing);
      const double gap = off_plane * resolution_.fine;
      for (Vector3& x : mesh.vertices)
        if (const double h = scenario_.height(x); std::abs(h) < gap)
          x += ((h < 0 ? -gap : gap) - h) * scenario_.frame.normal;
      quality_ = smallest_quality(mesh.vertices, mesh.tets);
      nodes_ = number_nodes(uncut(mesh), scenario_, element_);
    }
    {
      const StageClock clock(increment.times, Stage::factorisation);
      place_ = elimination_places(nodes_, placed_);
      couple();
    }
    cells_.clear();
    for (int e = 0; e < std::ssize(nodes_.elements); ++e)
      cells_.emplace_back(StraightCell(nodes_, e));
    whole_rule_ = level_set_rules(unit_cell(), front_order, false).front();
    return follow(std::move(increment));
  }

  Increment advance(int to) override {
    number_ = to;
    return follow({});
  }

  Opening opening() const override {
    Opening opening;
    opening.volume = 0;
    const std::vector<Vector2> outline = scenario_.outline(number_);
    const FrontDistance front(scenario_, number_);
    const Vector3& normal = scenario_.frame.normal;
    double error = 0, size = 0, nearest = std::numeric_limits<double>::infinity();
    for (const Cell& cell : cells_) {
      if (cell.state != CellState::split && cell.state != CellState::front)
        continue;
      VectorX across(std::ssize(cell.functions));
      for (std::size_t f = 0; f < cell.functions.size(); ++f)
        across[static_cast<Eigen::Index>(f)] = unknown(cell.functions[f]).dot(normal);
      for (const CutPoint& point : cut_points(cell.shape, scenario_, outline, cell.state)) {
        const double found = jumps(cell.shape, cell.functions, point.place, front).dot(across);
        opening.volume += point.area * found;
        if (scenario_.exact_opening) {
          const double wanted = scenario_.exact_opening(cell.shape.position(point.place));
          error += point.area * (found - wanted) * (found - wanted);
          size += point.area * wanted * wanted;
        }
      }
      const std::array<double, 4> l = cell.shape.place(scenario_.marked);
      if (const double outside = -*std::min_element(l.begin(), l.end()); outside < nearest) {
        nearest = outside;
        opening.marked = jumps(cell.shape, cell.functions, l, front).dot(across);
      }
    }
    if (scenario_.exact_opening)
      opening.profile_error = std::sqrt(error / size);
    if (!scenario_.force_direction.isZero(0))
      opening.force = tool_force();
    return opening;
  }

  double condition() const override {
    return solvers::condition_estimate(*factor_, norm_, static_cast<int>(solution_.size()));
  }

 private:
  struct Cell {
    explicit Cell(const StraightCell& geometry) : shape(geometry) {}
    StraightCell shape;
    CellState state = CellState::whole;
    std::vector<CellFunction> functions;
    bool at_front = false; // some functions belong to the front
    CellRule split_rule;   // of an element cut through, kept while it is
    int split_order = 0;
    MatrixX stiffness;
    VectorX load; // of a unit pressure in the direction of the normal, by function
  };

  static LevelSetCells unit_cell() {
    return {{Vector3::Zero(), Vector3::UnitX(), Vector3::UnitY(), Vector3::UnitZ()},
            {{0, 1, 2, 3}},
            {1, 1, 1, 1},
            {1, 1, 1, 1}};
  }

  Increment follow(Increment increment) {
    increment.number = number_;
    increment.quality = quality_;
    try {
      const FrontDistance front(scenario_, number_);
      {
        const StageClock clock(increment.times, Stage::topology);
        find_states(front);
        enrich(front);
        cut(front);
      }
      FemSystem system;
      {
        const StageClock clock(increment.times, Stage::assembly);
        integrate(front);
        system = put_together();
      }
      {
        const StageClock clock(increment.times, Stage::factorisation);
        factor_.reset();
        factor_ = solvers::factor_ordered(system.lower);
      }
      {
        const StageClock clock(increment.times, Stage::solve);
        solution_ = factor_->solve(system.right);
      }
      norm_ = solvers::one_norm(system.lower, true);
      increment.unknowns = static_cast<int>(solution_.size());
    } catch (const NumericalError& error) {
      increment.failure = error.what();
    }
    return increment;
  }

  void find_states(const FrontDistance& front) {
    for (Cell& cell : cells_) {
      const CellState before = cell.state;
      const std::vector<Vector3> points = crossings(cell.shape, scenario_);
      const auto behind =
          std::count_if(points.begin(), points.end(), [&](const Vector3& x) { return front.at(x).ahead < 0; });
      cell.state = points.empty()                 ? CellState::whole
                   : behind == std::ssize(points) ? CellState::split
                   : behind == 0                  ? CellState::ahead
                                                  : CellState::front;
      if (cell.state != before)
        cell.split_order = 0;
    }
  }

  /// Which nodes have a second displacement and which the functions of the front.
  void enrich(const FrontDistance& front) {
    const int n = nodes_.per_element();
    std::vector<char> parted(nodes_.positions.size(), 0), joined = parted;
    at_front_.assign(nodes_.positions.size(), 0);
    for (std::size_t e = 0; e < cells_.size(); ++e) {
      const Cell& cell = cells_[e];
      for (int k = 0; k < n; ++k) {
        const int v = nodes_.elements[e][k];
        parted[v] = parted[v] != 0 || cell.state == CellState::split ? 1 : 0;
        joined[v] = joined[v] != 0 || cell.state == CellState::front || cell.state == CellState::ahead ? 1 : 0;
        if (k < 4 && cell.state == CellState::front)
          at_front_[v] = 1;
      }
    }
    for (int v = 0; v < nodes_.corners(); ++v) {
      const FrontDistance::Place place = front.at(nodes_.positions[v]);
      if (std::hypot(place.ahead, place.height) < reach_ * resolution_.fine)
        at_front_[v] = 1;
      if (nodes_.held[v] != 0)
        at_front_[v] = 0;
    }
    two_sided_.assign(nodes_.positions.size(), 0);
    for (std::size_t v = 0; v < parted.size(); ++v)
      two_sided_[v] = parted[v] != 0 && joined[v] == 0 && nodes_.held[v] == 0 ? 1 : 0;
  }

  /// Rules of elements that are cut; those of elements cut through before are kept.
  void cut(const FrontDistance& front) {
    for (const bool singular : {false, true}) {
      for (const int order : {side_order, front_order}) {
        std::vector<std::size_t> wanted;
        for (std::size_t e = 0; e < cells_.size(); ++e) {
          Cell& cell = cells_[e];
          cell.at_front = touches_front(e);
          const int needed = cell.at_front ? front_order : side_order;
          if (needed == order &&
              (singular ? cell.state == CellState::front : cell.state == CellState::split && cell.split_order < order))
            wanted.push_back(e);
        }
        LevelSetCells cells;
        std::vector<int> number(nodes_.positions.size(), -1);
        for (std::size_t e : wanted) {
          std::array<int, 4> corners;
          for (std::size_t k = 0; k < 4; ++k) {
            int& v = number[nodes_.elements[e][k]];
            if (v < 0) {
              v = static_cast<int>(cells.corners.size());
              const Vector3& x = nodes_.positions[nodes_.elements[e][k]];
              cells.corners.push_back(x);
              cells.primary.push_back(scenario_.height(x));
              cells.secondary.push_back(singular ? front.at(x).ahead : -resolution_.fine);
            }
            corners[k] = v;
          }
          cells.cells.push_back(corners);
        }
        std::vector<CellRule> rules = level_set_rules(cells, order, singular);
        for (std::size_t i = 0; i < wanted.size(); ++i) {
          Cell& cell = cells_[wanted[i]];
          cell.split_rule = std::move(rules[i]);
          cell.split_order = order;
          cell.stiffness.resize(0, 0);
        }
      }
    }
  }

  [[nodiscard]] bool touches_front(std::size_t e) const {
    return std::any_of(nodes_.elements[e].begin(), nodes_.elements[e].begin() + 4,
                       [&](int v) { return at_front_[v] != 0; });
  }

  [[nodiscard]] std::vector<CellFunction> functions_of(std::size_t e) const {
    const Cell& cell = cells_[e];
    std::vector<CellFunction> functions;
    double height = 0;
    for (std::size_t k = 0; k < 4; ++k)
      height += scenario_.height(cell.shape.corner(k));
    const int n = nodes_.per_element();
    for (int k = 0; k < n; ++k) {
      const int v = nodes_.elements[e][k];
      if (two_sided_[v] == 0)
        functions.push_back({v, k, 0, 0});
      else if (cell.state == CellState::split) {
        functions.push_back({v, k, 0, 1});
        functions.push_back({v, k, 1, -1});
      } else // beside the cut
        functions.push_back({v, k, height > 0 ? 0 : 1, 0});
    }
    for (int k = 0; k < 4; ++k)
      if (const int v = nodes_.elements[e][k]; at_front_[v] != 0)
        for (int f = 0; f < front_functions; ++f)
          functions.push_back({v, k, 1 + two_sided_[v] + f, 0, f});
    return functions;
  }

  /// Stiffness and loads where the functions have changed, or belong to the front, which has moved.
  void integrate(const FrontDistance& front) {
    const std::vector<Vector2> outline = scenario_.outline(number_);
    const auto same = [](const std::vector<CellFunction>& a, const std::vector<CellFunction>& b) {
      return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const CellFunction& x, const CellFunction& y) {
        return x.side == y.side && x.front == y.front;
      });
    };
    MatrixX whole;
    for (std::size_t e = 0; e < cells_.size(); ++e) {
      Cell& cell = cells_[e];
      std::vector<CellFunction> functions = functions_of(e);
      const bool kept = cell.stiffness.size() > 0 && !cell.at_front && same(functions, cell.functions);
      cell.functions = std::move(functions);
      if (kept)
        continue;
      const bool is_cut = cell.state == CellState::split || cell.state == CellState::front;
      if (is_cut || cell.at_front)
        cell.stiffness = enriched_stiffness(cell.shape, cell.functions, is_cut ? cell.split_rule : scaled_rule(cell),
                                            front, scenario_);
      else
        element_stiffness(nodes_, static_cast<int>(e), scenario_.material, cell.stiffness);
      cell.load.resize(0);
      if (is_cut && scenario_.pressure != 0) {
        cell.load = VectorX::Zero(std::ssize(cell.functions));
        for (const CutPoint& point : cut_points(cell.shape, scenario_, outline, cell.state))
          cell.load += point.area * jumps(cell.shape, cell.functions, point.place, front);
      }
    }
  }

  [[nodiscard]] CellRule scaled_rule(const Cell& cell) const {
    CellRule rule = whole_rule_;
    for (double& weight : rule.weight)
      weight *= 6 * cell.shape.volume();
    return rule;
  }

  /// Which nodes share an element, below the diagonal by columns in the order of elimination.
  void couple() {
    beside_.assign(static_cast<std::size_t>(placed_), {});
    const int n = nodes_.per_element();
    for (const auto& e : nodes_.elements)
      for (int a = 0; a < n; ++a)
        if (place_[e[a]] >= 0)
          for (int b = 0; b < n; ++b)
            if (place_[e[b]] > place_[e[a]])
              beside_[place_[e[a]]].push_back(place_[e[b]]);
    for (auto& rows : beside_) {
      std::sort(rows.begin(), rows.end());
      rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    }
  }

  /// The unknowns of a node stand together, so that the order of the nodes remains one of little fill.
  FemSystem put_together() {
    first_.assign(static_cast<std::size_t>(placed_) + 1, 0);
    for (std::size_t v = 0; v < place_.size(); ++v)
      if (place_[v] >= 0)
        first_[place_[v] + 1] = 3 * (1 + two_sided_[v] + (at_front_[v] != 0 ? front_functions : 0));
    for (int j = 0; j < placed_; ++j)
      first_[j + 1] += first_[j];
    const Eigen::Index size = first_.back();
    FemSystem system;
    system.right = VectorX::Zero(size);
    system.lower.resize(size, size);
    std::vector<Eigen::Index> begin(static_cast<std::size_t>(size) + 1, 0);
    std::vector<int> height(static_cast<std::size_t>(placed_), 0); // rows below a node's own
    std::vector<std::vector<int>> offset(static_cast<std::size_t>(placed_));
    for (int j = 0; j < placed_; ++j) {
      for (int i : beside_[j]) {
        offset[j].push_back(height[j]);
        height[j] += first_[i + 1] - first_[i];
      }
      for (int c = first_[j]; c < first_[j + 1]; ++c)
        begin[c + 1] = begin[c] + first_[j + 1] - c + height[j];
    }
    system.lower.resizeNonZeros(begin.back());
    int* outer = system.lower.outerIndexPtr();
    int* inner = system.lower.innerIndexPtr();
    double* value = system.lower.valuePtr();
    std::fill(value, value + begin.back(), 0.0);
    for (Eigen::Index c = 0; c <= size; ++c)
      outer[c] = static_cast<int>(begin[c]);
    for (int j = 0; j < placed_; ++j)
      for (int c = first_[j]; c < first_[j + 1]; ++c) {
        Eigen::Index at = begin[c];
        for (int d = c; d < first_[j + 1]; ++d)
          inner[at++] = d;
        for (int i : beside_[j])
          for (int d = first_[i]; d < first_[i + 1]; ++d)
            inner[at++] = d;
      }
    for (const Cell& cell : cells_) {
      const auto& functions = cell.functions;
      for (std::size_t b = 0; b < functions.size(); ++b) {
        const int j = place_[functions[b].node];
        const auto column = static_cast<Eigen::Index>(3 * b);
        if (j < 0) {
          const Vector3& u = nodes_.prescribed[functions[b].node];
          for (std::size_t a = 0; a < functions.size(); ++a)
            if (place_[functions[a].node] >= 0)
              system.right.segment<3>(row_of(functions[a])) -=
                  cell.stiffness.block<3, 3>(static_cast<Eigen::Index>(3 * a), column) * u;
          continue;
        }
        if (cell.load.size() > 0)
          system.right.segment<3>(row_of(functions[b])) +=
              scenario_.pressure * cell.load[static_cast<Eigen::Index>(b)] * scenario_.frame.normal;
        for (std::size_t a = 0; a < functions.size(); ++a) {
          const int i = place_[functions[a].node];
          if (i < j)
            continue;
          const int row = 3 * functions[a].sub;
          const auto line = static_cast<Eigen::Index>(3 * a);
          Eigen::Index below = 0;
          if (i > j)
            below = offset[j][static_cast<std::size_t>(std::lower_bound(beside_[j].begin(), beside_[j].end(), i) -
                                                       beside_[j].begin())];
          for (int c = 0; c < 3; ++c) {
            const int own = 3 * functions[b].sub + c, c0 = first_[j] + own;
            const Eigen::Index diagonal = begin[c0] - own;
            for (int d = 0; d < 3; ++d) {
              if (i == j && row + d < own)
                continue;
              const Eigen::Index at = i == j ? diagonal + row + d : begin[c0] + (first_[j + 1] - c0) + below + row + d;
              value[at] += cell.stiffness(line + d, column + c);
            }
          }
        }
      }
    }
    return system;
  }

  [[nodiscard]] Eigen::Index row_of(const CellFunction& f) const {
    return first_[place_[f.node]] + 3 * static_cast<Eigen::Index>(f.sub);
  }

  [[nodiscard]] Vector3 unknown(const CellFunction& f) const {
    return place_[f.node] < 0 ? nodes_.prescribed[f.node] : Vector3(solution_.segment<3>(row_of(f)));
  }

  [[nodiscard]] double tool_force() const {
    double sum = 0;
    for (const Cell& cell : cells_) {
      const auto is_tool = [&](const CellFunction& f) {
        return nodes_.held[f.node] != 0 && scenario_.tool(nodes_.positions[f.node]);
      };
      if (std::none_of(cell.functions.begin(), cell.functions.end(), is_tool))
        continue;
      VectorX u(3 * std::ssize(cell.functions));
      for (std::size_t f = 0; f < cell.functions.size(); ++f)
        u.segment<3>(static_cast<Eigen::Index>(3 * f)) = unknown(cell.functions[f]);
      const VectorX force = cell.stiffness * u;
      for (std::size_t f = 0; f < cell.functions.size(); ++f)
        if (is_tool(cell.functions[f]))
          sum += scenario_.force_direction.dot(force.segment<3>(static_cast<Eigen::Index>(3 * f)));
    }
    return sum;
  }

  Scenario scenario_;
  Resolution resolution_;
  Element element_;
  double reach_; // sizes at the front: so far corners have its functions
  double limit_;
  int number_;
  double quality_ = 0;
  FemNodes nodes_;
  std::vector<Cell> cells_;
  CellRule whole_rule_;                    // of an element that is not cut, of volume 1/6
  std::vector<char> two_sided_, at_front_; // by node
  std::vector<int> place_;                 // of the nodes in the order of elimination, -1: held
  int placed_ = 0;
  std::vector<std::vector<int>> beside_;
  std::vector<int> first_; // unknown of the node at each place
  std::unique_ptr<solvers::OrderedCholesky> factor_;
  VectorX solution_;
  double norm_ = 0;
};

} // namespace

bool has_xfem() {
  return true;
}

std::unique_ptr<BackEnd> make_xfem(const Scenario& scenario, const Resolution& resolution, Element element,
                                   double limit) {
  const double reach = element == Element::linear ? 2.0 : 0.7;
  return std::make_unique<XFem>(scenario, resolution, element, reach, limit);
}

} // namespace spherecut::experiments::ledger
