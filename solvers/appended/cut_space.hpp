// The functions that a cut appends to those of the uncut body: twins of spheres that the sheets part, and functions
// gathered along the front. The functions of the uncut body stay what they are.
#pragma once

#include "solvers/appended/front_places.hpp"

#include <memory>
#include <set>

namespace spherecut::solvers {

struct CutSpaceOptions {
  FrontOptions front;
  /// Spheres that a curved front ends in have twins too, with a step that closes at the front over `step_reach`
  /// spacings (0: none has). A run of the front is curved where it turns by more than `step_turn` within a sphere over
  /// most of its length; on straight ones, corners included, the front functions do as well with half as many, and
  /// only spheres have one that are so much larger than those at the front that its functions do not carry their nodes.
  double step_reach = 1;
  double step_turn = 20; // degrees
  /// Where the shape function of a sphere is nowhere on the cut larger than this, it has no step: a large sphere among
  /// small ones, which open the cut by themselves. A step of its own would change what it does far from the cut. By
  /// runs that holds for spheres whose node is so much coarser than the one nearest to the cut.
  double step_share = 0.1;
  double step_coarser = 1.2;
  double shallow = 1.2; // radii of a sphere: a cut that reaches no farther behind its front parts no sphere there
  /// A step for every run of the front that ends in a sphere, or in a part of it that is parted from its node, whatever
  /// the run's shape: where two fronts are near, each step knows of its own alone and is smooth.
  bool steps_by_run = false;
  /// Spacings of a sphere's node: a run shorter than that has no step in the sphere where a longer one ends in it, too.
  /// A hand that turns its blade leaves many such runs, each a bridge of tissue far below what the nodes resolve.
  double short_run = 1;
  double corner = 45; // degrees from one segment to the next: a corner, which is no curvature
};

/// Steps by run in place of functions along the front. Those are of near-tip fields, which do not turn with the tissue
/// and do not hold where something presses within their reach of the front.
CutSpaceOptions steps_alone();

/// A second vector unknown of a sphere: h_J psi. Where the cut parts the sphere, psi is 1 in one component of what is
/// hidden from its node and 0 elsewhere. Where a front ends in it, psi = (step(x) - step(x_J)) / 2,
///
///   step = sign(b) q(t),  t^2 = (r - a) / (2 R),  q = (15 t - 10 t^3 + 3 t^5) / 8, 1 beyond t = 1,
///
/// which opens like sqrt(r) behind the front.
struct Twin {
  int node = -1;
  std::vector<PartId> hidden; // ascending; of a step: all parts in reach of the sphere, by runs those that it opens
  bool is_step = false;
  int run = -1; // of a step by runs: that of the front; it is one in its `hidden` parts alone
  double step_at_node = 0, step_length = 0; // of a step; m
};

/// One of the appended functions. Each has three unknowns: the components of a twin, the modes of a front group.
struct CutFunction {
  int id = -1; // stays with the function for as long as it is there
  bool is_front = false;
  Twin twin;
  FrontGroup group;
};

/// A twin at a point: h psi and its gradient.
struct ScalarTerm {
  int function;
  double value;
  Vector3 gradient;
};
/// A front group at a point: what its three unknowns do.
struct FrontTerm {
  int function;
  Matrix3 value;                   // columns: modes
  std::array<Matrix3, 3> gradient; // of every mode, du_i/dx_j, 1/m
};
struct CutTerms {
  std::vector<ScalarTerm> scalar;
  std::vector<FrontTerm> front;
  void clear() {
    scalar.clear();
    front.clear();
  }
};

class CutSpace {
 public:
  /// Base nodes and their spheres; all outlive this.
  CutSpace(const SmallBoxes& boxes, const topology::Domain& domain, const NodeCloud& nodes, const Spheres& spheres,
           const Material& material, CutSpaceOptions options);

  /// What an increment of the cut did to the functions.
  struct Change {
    std::vector<int> kept; // places of functions that go on as they were, in the list before; they come first, in order
    int added = 0;         // functions at the end of the list
  };
  /// Follows the cut to `incision`, which differs from the one before in `region` alone.
  Change update(std::shared_ptr<const topology::Incision> incision, const BoundingBox& region);

  [[nodiscard]] const std::vector<CutFunction>& functions() const { return functions_; }
  [[nodiscard]] const CutBoxes& cut() const { return cut_; }
  [[nodiscard]] const topology::Incision* incision() const { return incision_.get(); }
  /// Cells in which a function may differ from zero, ascending.
  [[nodiscard]] std::vector<int> cells_of(const CutFunction& function) const;
  /// Samples of a part for functions that know of the front; the others take the part as one.
  [[nodiscard]] const PlacedPart& samples(PartId part) const { return places_.of(cut_, part); }
  /// How many samples a part has as far as functions have been asked for there.
  [[nodiscard]] int known_samples(PartId part) const { return places_.known_samples(part); }
  /// Twins and steps of a node, by their places among the functions.
  [[nodiscard]] const std::vector<int>& twins_of(int node) const { return twins_of_[node]; }
  /// Term of a twin at a part of a box, or of a step at one of its samples, with the box's linear shape functions.
  /// False: it vanishes there.
  bool term_at(int k, PartId part, int sample, ScalarTerm& term) const;
  /// Calls visit(part, sample, term) for the terms in a cell of the front groups from function `first` on, at all
  /// samples of all parts where they do not vanish; parts and samples of a group ascend.
  template <class Visit>
  void for_each_front_term(int first, int cell, Visit&& visit) const;
  /// Cells in which some front group from function `first` on may differ from zero, ascending.
  [[nodiscard]] std::vector<int> cells_of_groups(int first) const;
  /// The part that x lies in, or next to.
  [[nodiscard]] PartId part_at(const Vector3& x) const {
    return incision_ == nullptr ? part_id(boxes_.locate(x), 0) : cut_.part_at(x, *incision_);
  }
  /// All that do not vanish at x, in a part, with shape functions at x.
  void terms_at(const Vector3& x, PartId part, const ShapeFunctions& shape, CutTerms& terms) const;
  /// Takes spheres out of shape functions evaluated at x whose twin in the part, or what they would have there, weighs
  /// next to nothing in the boxes: their unknowns say nothing of x. The others go on reproducing linear functions.
  void take_out_faint(const Vector3& x, PartId part, ShapeFunctions& shape) const;

 private:
  void add_twins(int node, std::vector<CutFunction>& found);
  [[nodiscard]] bool hangs_together(int node, const std::vector<int>& divided);
  [[nodiscard]] bool is_connected(int node);
  int find_components(const std::vector<PartId>& parts, std::vector<int>& component, const std::vector<char>& marked);
  [[nodiscard]] std::vector<char> faint_of(int node, const std::vector<PartId>& parts) const;
  [[nodiscard]] double energy_in(int node, PartId part) const;
  void add_step(int node, std::vector<PartId> parts, std::vector<CutFunction>& found) const;
  void add_run_steps(int node, const std::vector<PartId>& parts, const std::vector<int>& component, int count, int own,
                     std::vector<CutFunction>& found);
  [[nodiscard]] bool is_opened(const std::vector<PartId>& parts, int run, double shorter);
  [[nodiscard]] double largest_on_cut(int node, const std::vector<int>& divided) const;
  [[nodiscard]] double spacing_on_cut(int node) const;
  void find_curved_front();
  [[nodiscard]] std::set<int> concerned_nodes(const std::vector<char>& changed, const BoundingBox& region,
                                              bool all) const;
  struct Wanted;
  bool front_stays(CutFunction& old, const std::vector<char>& cell_changed, Wanted& wanted) const;
  bool twin_stays(CutFunction& old, const std::vector<char>& changed, const std::set<int>& concerned, Wanted& wanted);
  void list_by_node();
  [[nodiscard]] FrontTerm front_term(int k, double value, const Vector3& gradient, PlaceAtRun& placed) const;
  [[nodiscard]] std::optional<double> jump_at(const Twin& twin, PartId part, int sample, Vector3& slope) const;
  [[nodiscard]] bool varies(const Twin& twin) const;
  [[nodiscard]] double step(const FrontPlace* place, const Vector3& x, double length, Vector3& gradient) const;

  const SmallBoxes& boxes_;
  const topology::Domain& domain_;
  const NodeCloud& nodes_;
  const Spheres& spheres_;
  Material material_;
  CutSpaceOptions options_;
  CutBoxes cut_;
  mutable FrontPlaces places_;
  std::shared_ptr<const topology::Incision> incision_;
  std::vector<CutFunction> functions_;
  std::vector<std::vector<int>> twins_of_, groups_of_; // places in functions_ by node
  std::vector<std::vector<double>> group_weights_;
  std::vector<std::vector<PartId>> faint_; // by node: hidden parts in its reach without a twin that weighs, ascending
  /// Blended hats of a front group over the boxes of a cell.
  struct Blend {
    int function;
    std::array<double, BoxShapes::lanes> middle{};        // at the middles of the boxes
    std::array<double, 3 * BoxShapes::lanes> gradients{}; // 1/m, [lane][axis]
  };
  mutable std::vector<Blend> blends_;  // of one cell
  mutable std::vector<int> blend_of_;  // by function, -1 between calls
  mutable std::vector<int> local_;     // of a part among those of a sphere, -1 between calls
  std::vector<signed char> connected_; // by node: the boxes in reach hang together without a cut; -1: not known
  std::vector<char> curved_;           // by segment of the front: its run is curved
  std::vector<double> carried_;        // m, likewise: nodes so near to it carry functions along the front
  int next_id_ = 0;
};

template <class Visit>
void CutSpace::for_each_front_term(int first, int cell_index, Visit&& visit) const {
  const BoxShapes& cell = boxes_.cells()[cell_index];
  const auto count = std::ssize(cell.nodes);
  blends_.clear();
  blend_of_.resize(std::max(blend_of_.size(), functions_.size()), -1);
  for (std::ptrdiff_t n = 0; n < count; ++n) {
    const std::vector<int>& groups = groups_of_[cell.nodes[n]];
    for (std::size_t g = 0; g < groups.size(); ++g) {
      if (groups[g] < first)
        continue;
      int& at = blend_of_[groups[g]];
      if (at < 0) {
        at = static_cast<int>(blends_.size());
        blends_.push_back({groups[g], {}, {}});
      }
      Blend& blend = blends_[at];
      const double weight = group_weights_[cell.nodes[n]][g];
      for (int lane = 0; lane < BoxShapes::lanes; ++lane)
        blend.middle[lane] += weight * cell.value[n * BoxShapes::lanes + lane];
      const double* gradient = cell.gradients.data() + n;
      for (int k = 0; k < 3 * cell.boxes; ++k, gradient += count)
        blend.gradients[k] += weight * *gradient;
    }
  }
  for (const Blend& blend : blends_)
    blend_of_[blend.function] = -1;
  for (int lane = 0; lane < cell.boxes; ++lane) {
    const int box = cell.first_box + lane;
    const Vector3& centre = boxes_.boxes()[box].middle;
    for (int p = 0; p < cut_.part_count(box); ++p) {
      const PartId part = part_id(box, p);
      PlacedPart* samples = nullptr;
      for (const Blend& blend : blends_) {
        const Vector3 gradient = Vector3::Map(blend.gradients.data() + 3 * lane);
        if (blend.middle[lane] == 0 && gradient.isZero(0))
          continue;
        if (samples == nullptr)
          samples = &places_.of(cut_, part);
        for (int n = 0; n < std::ssize(*samples); ++n)
          if (PlaceAtRun* const at = places_.at_run((*samples)[n], functions_[blend.function].group.run); at != nullptr)
            visit(part, n,
                  front_term(blend.function, blend.middle[lane] + gradient.dot((*samples)[n].at - centre), gradient,
                             *at));
      }
    }
  }
}

} // namespace spherecut::solvers
