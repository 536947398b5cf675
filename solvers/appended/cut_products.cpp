// What the functions that a cut appends do to one another and to those of the uncut body: elastic products, cell by
// cell.
#include "solvers/appended/cut_system.hpp"

#include "solvers/algebra/dense_products.hpp"

#include <algorithm>

namespace spherecut::solvers {

namespace {

constexpr int most_samples = 16; // of a part

} // namespace

void CutSystem::evaluate_twin(int function, FunctionData& data) const {
  const Twin& twin = space_->functions()[function].twin;
  for (const PartId part : twin.hidden) {
    const int samples = data.is_sampled ? static_cast<int>(space_->samples(part).size()) : 1;
    bool any = false;
    std::array<double, 3 * most_samples> gradients{};
    for (int n = 0; n < samples; ++n)
      if (ScalarTerm term; space_->term_at(function, part, n, term)) {
        any = true;
        std::copy_n(term.gradient.data(), 3, gradients.data() + 3 * n);
      }
    if (!any)
      continue;
    data.gradients.insert(data.gradients.end(), gradients.data(), gradients.data() + 3 * samples);
    data.parts.insert(data.parts.end(), samples, part);
  }
}

void CutSystem::evaluate(int first_new) {
  for (int k = first_new; k < std::ssize(space_->functions()); ++k) {
    const CutFunction& own = space_->functions()[k];
    FunctionData& data = data_.emplace_back();
    data.id = own.id;
    data.is_front = own.is_front;
    data.is_sampled = own.is_front || own.twin.is_step;
    if (!own.is_front)
      evaluate_twin(k, data);
  }
  for (const int cell : space_->cells_of_groups(first_new))
    space_->for_each_front_term(first_new, cell, [&](PartId part, int, const FrontTerm& term) {
      FunctionData& data = data_[term.function];
      data.parts.push_back(part);
      const std::size_t size = data.gradients.size();
      data.gradients.resize(size + 27);
      double* to = data.gradients.data() + size;
      for (const Matrix3& gradient : term.gradient) {
        const Matrix3 rows = gradient.transpose(); // in memory row by row of the gradient
        to = std::copy_n(rows.data(), 9, to);
      }
    });
}

/// Products over the parts of one cell, as many together as there are lanes.
struct CutSystem::CellProducts {
  static constexpr int lanes = BoxShapes::lanes;
  std::vector<PartId> parts;                             // once for each sample
  std::vector<double> weights;                           // m3, of every one of them
  std::vector<int> twins, groups, new_twins, new_groups; // functions here, ascending
  std::vector<std::size_t> next;                         // entry of every twin, then of every group
  bool is_plain = false;                                 // neither twins nor divided boxes: as in most cells
  // Of the parts from `first` on, `count` of them:
  std::size_t first = 0;
  int count = 0;
  std::array<double, lanes> weight{};
  MatrixX gradient;          // row: base function or twin; column 3 l + axis
  MatrixX flat;              // the same of one axis
  MatrixX pull;              // w g of new twins: row l, column 3 t + axis
  MatrixX of_groups, stress; // row 3 t + m: gradients, column 9 l + 3 i + j; row 3 l + j: w sigma_ij of new ones
  MatrixX stress_columns;    // row 9 l + 3 i + j, column 3 t + m
  // Over all parts:
  MatrixX with_groups, group_pairs, group_twin;
  std::array<MatrixX, 3> with_twins; // by axis of the gradient

  /// Calls visit(lane, gradients) for the entries of a function at the parts that are at hand; `at`: its next entry.
  template <class Visit>
  void for_entries(const FunctionData& of, std::size_t& at, const Visit& visit) const {
    for (int l = 0; l < count && at < of.parts.size(); ++l)
      if (of.parts[at] == parts[first + l]) {
        visit(l, of.gradients.data() + of.stride() * at);
        if (of.is_sampled || first + l + 1 == parts.size() || parts[first + l + 1] != parts[first + l])
          ++at;
      }
  }
};

void CutSystem::add_elastic(int first_new) {
  const SmallBoxes& boxes = uncut_.boxes();
  std::map<int, std::vector<int>> fresh;     // new functions by cell
  std::vector<int> taken(uncut_.size(), -1); // by the function that couples with it, the last to do so
  for (int k = first_new; k < functions(); ++k) {
    FunctionData& own = data_[k];
    int last = -1;
    for (const PartId part : own.parts) {
      const int cell = boxes.cell_of(box_of(part));
      if (cell == last)
        continue;
      last = cell;
      fresh[cell].push_back(k);
      for (const int node : boxes.cells()[cell].nodes)
        if (taken[node] != k) {
          taken[node] = k;
          own.nodes.push_back(node);
        }
    }
    std::sort(own.nodes.begin(), own.nodes.end());
    own.blocks.assign(own.nodes.size(), Matrix3::Zero());
  }
  CellProducts work;
  for (const auto& [cell, functions] : fresh)
    add_cell(cell, functions, work);
}

/// The parts of a cell with their volumes, and the functions that do not vanish there.
void CutSystem::list_cell(int cell_index, std::span<const int> fresh, CellProducts& work) const {
  const SmallBoxes& boxes = uncut_.boxes();
  const BoxShapes& cell = boxes.cells()[cell_index];
  for (auto* list : {&work.parts, &work.twins, &work.groups, &work.new_twins, &work.new_groups})
    list->clear();
  work.weights.clear();
  for (int box = cell.first_box; box < cell.first_box + cell.boxes; ++box)
    for (int k = 0; k < space_->cut().part_count(box); ++k) {
      const PartId part = part_id(box, k);
      const double volume = space_->cut().part(part).share * boxes.boxes()[box].volume;
      if (space_->known_samples(part) == 1) {
        work.parts.push_back(part);
        work.weights.push_back(volume);
        continue;
      }
      for (const PlacedSample& sample : space_->samples(part)) {
        work.parts.push_back(part);
        work.weights.push_back(sample.share * volume);
      }
    }
  for (const int k : in_cell_[cell_index])
    (data_[k].is_front ? work.groups : work.twins).push_back(k);
  for (const int k : fresh)
    (data_[k].is_front ? work.new_groups : work.new_twins).push_back(k);
  work.next.clear();
  for (const auto* list : {&work.twins, &work.groups})
    for (const int k : *list)
      work.next.push_back(static_cast<std::size_t>(
          std::lower_bound(data_[k].parts.begin(), data_[k].parts.end(), work.parts.front()) - data_[k].parts.begin()));
  work.is_plain = work.twins.empty() && std::ssize(work.parts) == cell.boxes;
}

// Products of the new functions with everything in a cell. With g the gradient of a base function or twin, and of a new
// function the stress w sigma_m of its modes or w g of a twin,
//
//   base or twin with group:  block(c, m) = sum of (w sigma_m g)_c,
//   base or twin with twin:   products G = sum of g (w g')^T, then lambda G + mu G^T + mu tr G,
//   group with group:         sum of grad_m : w sigma_n.
void CutSystem::add_cell(int cell_index, std::span<const int> fresh, CellProducts& work) {
  constexpr int lanes = CellProducts::lanes;
  const BoxShapes& cell = uncut_.boxes().cells()[cell_index];
  list_cell(cell_index, fresh, work);
  const auto group_count = std::ssize(work.groups), fresh_twins = std::ssize(work.new_twins),
             fresh_groups = std::ssize(work.new_groups), rows = std::ssize(cell.nodes) + std::ssize(work.twins);
  work.with_groups.setZero(rows, 9 * fresh_groups);
  work.group_pairs.setZero(3 * group_count, 3 * fresh_groups);
  work.group_twin.setZero(fresh_twins, 9 * group_count);
  if (fresh_twins > 0)
    for (MatrixX& products : work.with_twins)
      products.setZero(rows, 3 * fresh_twins);
  for (work.first = 0; work.first < work.parts.size(); work.first += lanes) {
    work.count = static_cast<int>(std::min<std::size_t>(lanes, work.parts.size() - work.first));
    work.weight.fill(0);
    std::copy_n(work.weights.begin() + static_cast<std::ptrdiff_t>(work.first), work.count, work.weight.begin());
    if (!work.is_plain)
      gather_gradients(cell, work);
    if (fresh_twins > 0)
      multiply_twins(cell, work);
    if (group_count == 0)
      continue;
    gather_groups(work);
    if (work.is_plain) // the gradients are those of the cell as they lie there
      add_product(static_cast<int>(rows), static_cast<int>(9 * fresh_groups), 3 * cell.boxes, cell.gradients.data(),
                  static_cast<int>(std::ssize(cell.nodes)), work.stress.data(), 3 * lanes, work.with_groups.data(),
                  static_cast<int>(rows));
    else
      add_product(1, work.gradient, false, work.stress, work.with_groups);
    add_product(1, work.of_groups, false, work.stress_columns, work.group_pairs);
    multiply_groups_with_twins(work);
  }
  distribute(cell_index, work);
}

/// Gradients of base functions and twins at the parts at hand.
void CutSystem::gather_gradients(const BoxShapes& cell, CellProducts& work) const {
  const SmallBoxes& boxes = uncut_.boxes();
  const auto base = std::ssize(cell.nodes), twin_count = std::ssize(work.twins), rows = base + twin_count;
  MatrixX& gradient = work.gradient;
  gradient.setZero(rows, 3 * CellProducts::lanes);
  for (int l = 0; l < work.count; ++l)
    for (int a = 0; a < 3; ++a)
      std::copy_n(cell.gradients.data() + (3 * boxes.lane_of(box_of(work.parts[work.first + l])) + a) * base, base,
                  gradient.data() + (3 * l + a) * rows);
  for (Eigen::Index t = 0; t < twin_count; ++t)
    work.for_entries(data_[work.twins[t]], work.next[t], [&](int l, const double* g) {
      for (int a = 0; a < 3; ++a)
        gradient(base + t, 3 * l + a) = g[a];
    });
}

/// Adds the products of base functions and twins with new twins.
void CutSystem::multiply_twins(const BoxShapes& cell, CellProducts& work) {
  constexpr int lanes = CellProducts::lanes;
  const std::vector<int>& twins = work.twins;
  const auto base = std::ssize(cell.nodes), fresh_twins = std::ssize(work.new_twins);
  work.pull.resize(lanes, 3 * fresh_twins);
  for (Eigen::Index t = 0; t < fresh_twins; ++t) {
    const auto row = base + (std::lower_bound(twins.begin(), twins.end(), work.new_twins[t]) - twins.begin());
    for (int l = 0; l < lanes; ++l)
      for (int a = 0; a < 3; ++a)
        work.pull(l, 3 * t + a) = work.weight[l] * work.gradient(row, 3 * l + a);
  }
  work.flat.resize(base + std::ssize(twins), lanes);
  for (int a = 0; a < 3; ++a) {
    for (int l = 0; l < lanes; ++l)
      work.flat.col(l) = work.gradient.col(3 * l + a);
    add_product(1, work.flat, false, work.pull, work.with_twins[a]);
  }
}

/// Gradients of the groups at the parts at hand, and the stress of the new ones.
void CutSystem::gather_groups(CellProducts& work) const {
  constexpr int lanes = CellProducts::lanes;
  const Material& material = uncut_.problem().material;
  const double lambda = material.lame_lambda(), mu = material.shear_modulus();
  const std::vector<int>&groups = work.groups, &new_groups = work.new_groups;
  const auto group_count = std::ssize(groups), fresh_groups = std::ssize(new_groups);
  work.of_groups.setZero(3 * group_count, 9 * lanes);
  work.stress.setZero(3 * lanes, 9 * fresh_groups);
  work.stress_columns.setZero(9 * lanes, 3 * fresh_groups);
  for (Eigen::Index t = 0; t < group_count; ++t) {
    const auto at = std::lower_bound(new_groups.begin(), new_groups.end(), groups[t]);
    const Eigen::Index own = at != new_groups.end() && *at == groups[t] ? at - new_groups.begin() : -1;
    work.for_entries(data_[groups[t]], work.next[work.twins.size() + t], [&](int l, const double* g) {
      for (int m = 0; m < 3; ++m, g += 9) {
        for (int e = 0; e < 9; ++e)
          work.of_groups(3 * t + m, 9 * l + e) = g[e];
        if (own < 0)
          continue;
        const double dilatation = lambda * (g[0] + g[4] + g[8]);
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j) {
            const double sigma = work.weight[l] * (mu * (g[3 * i + j] + g[3 * j + i]) + (i == j ? dilatation : 0));
            work.stress(3 * l + j, 9 * own + 3 * m + i) = sigma; // columns 3 m + c: component c of mode m
            work.stress_columns(9 * l + 3 * i + j, 3 * own + m) = sigma;
          }
      }
    });
  }
}

/// Kept groups with new twins: the twins' w g against the stress of the groups.
void CutSystem::multiply_groups_with_twins(CellProducts& work) const {
  const Material& material = uncut_.problem().material;
  const double lambda = material.lame_lambda(), mu = material.shear_modulus();
  const auto fresh_twins = std::ssize(work.new_twins);
  for (Eigen::Index t = 0; t < std::ssize(work.groups) && fresh_twins > 0; ++t)
    for (int l = 0; l < work.count; ++l)
      for (int m = 0; m < 3; ++m) {
        const auto at = [&](int i, int j) { return work.of_groups(3 * t + m, 9 * l + 3 * i + j); };
        const double dilatation = lambda * (at(0, 0) + at(1, 1) + at(2, 2));
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j) {
            const double sigma = mu * (at(i, j) + at(j, i)) + (i == j ? dilatation : 0);
            for (Eigen::Index n = 0; n < fresh_twins; ++n)
              work.group_twin(n, 9 * t + 3 * m + i) += sigma * work.pull(l, 3 * n + j);
          }
      }
}

// The sums of a cell go to where they belong.
void CutSystem::distribute(int cell_index, const CellProducts& work) {
  const BoxShapes& cell = uncut_.boxes().cells()[cell_index];
  const Material& material = uncut_.problem().material;
  const double lambda = material.lame_lambda(), mu = material.shear_modulus();
  const auto base = std::ssize(cell.nodes);
  const auto twin_block = [&](Eigen::Index row, Eigen::Index twin) {
    Matrix3 products;
    for (int a = 0; a < 3; ++a)
      products.row(a) = work.with_twins[a].block<1, 3>(row, 3 * twin);
    Matrix3 block = lambda * products + mu * products.transpose();
    block.diagonal().array() += mu * products.trace();
    return block;
  };
  const auto add_pair = [&](int other, int k, const Matrix3& block) {
    elastic_.block<3, 3>(3 * static_cast<Eigen::Index>(other), 3 * static_cast<Eigen::Index>(k)) += block;
    if (other != k)
      elastic_.block<3, 3>(3 * static_cast<Eigen::Index>(k), 3 * static_cast<Eigen::Index>(other)) += block.transpose();
  };
  for (Eigen::Index t = 0; t < std::ssize(work.new_groups); ++t) {
    const int k = work.new_groups[t];
    FunctionData& own = data_[k];
    const auto block_of = [&](Eigen::Index row) {
      Matrix3 block;
      for (int m = 0; m < 3; ++m)
        for (int c = 0; c < 3; ++c)
          block(c, m) = work.with_groups(row, 9 * t + 3 * m + c);
      return block;
    };
    std::size_t place = 0; // both lists ascend
    for (Eigen::Index n = 0; n < base; ++n) {
      while (own.nodes[place] != cell.nodes[n])
        ++place;
      own.blocks[place] += block_of(n);
    }
    for (Eigen::Index other = 0; other < std::ssize(work.twins); ++other)
      if (work.twins[other] < k)
        add_pair(work.twins[other], k, block_of(base + other));
    // Of a pair of new functions the later one counts; those that were there come first.
    for (Eigen::Index other = 0; other < std::ssize(work.groups); ++other)
      if (work.groups[other] <= k)
        add_pair(work.groups[other], k, work.group_pairs.block<3, 3>(3 * other, 3 * t));
  }
  for (Eigen::Index t = 0; t < std::ssize(work.new_twins); ++t) {
    const int k = work.new_twins[t];
    FunctionData& own = data_[k];
    std::size_t place = 0;
    for (Eigen::Index n = 0; n < base; ++n) {
      while (own.nodes[place] != cell.nodes[n])
        ++place;
      own.blocks[place] += twin_block(n, t);
    }
    for (Eigen::Index other = 0; other < std::ssize(work.twins); ++other)
      if (work.twins[other] <= k)
        add_pair(work.twins[other], k, twin_block(base + other, t));
    for (Eigen::Index other = 0; other < std::ssize(work.groups); ++other)
      if (work.groups[other] < k) {
        Matrix3 block; // rows: modes of the group
        for (int m = 0; m < 3; ++m)
          for (int c = 0; c < 3; ++c)
            block(m, c) = work.group_twin(t, 9 * other + 3 * m + c);
        add_pair(work.groups[other], k, block);
      }
  }
}

} // namespace spherecut::solvers
