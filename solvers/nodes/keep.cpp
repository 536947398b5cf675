// Which nodes of an earlier filling stay, and what a cut asks for beside them.
#include "solvers/nodes/filler.hpp"

#include <algorithm>
#include <utility>

namespace spherecut::solvers {

namespace {

constexpr double stretched_crowding = 0.8; // between previous nodes where h has grown, in units of their mean spacing
constexpr double seeded_crowding = 0.4;    // of previous lip nodes by seeds
// The range of placed / wanted spacing in which a node is kept.
constexpr double kept_finest = 0.75, kept_coarsest = 1.1;
constexpr double kept_clearance = 0.3; // of previous nodes from the sheets, in units of h
constexpr double thinnest = 0.05;      // a piece thinner than this many h stays flat
constexpr double thin_crowding = 0.5;  // between the lip nodes of a thin piece and those on its outer surface

} // namespace

void Filler::keep(const NodeCloud& previous) {
  kept_from_.assign(nodes_.size(), -1);
  std::vector<bool> stays(previous.size(), false);
  for (int s = 0; s < std::ssize(options_.seeds); ++s)
    for (int j = 0; j < previous.size(); ++j)
      if (!stays[j] && previous.positions[j] == options_.seeds[s].position) {
        kept_from_[s] = j;
        stays[j] = true;
        break;
      }
  for (int s = 0; s < size(); ++s)
    settled_.push_back(kept_from_[s] >= 0 && previous.spacings[kept_from_[s]] == nodes_.spacings[s]);
  keep_others(previous, std::move(stays));
}

void Filler::keep_around(const NodeCloud& previous, const std::vector<bool>& fixed) {
  for (int j = 0; j < previous.size(); ++j)
    if (fixed[j]) {
      add(previous.positions[j], spacing_(previous.positions[j]), previous.kinds[j], previous.normals[j]);
      kept_from_.push_back(j);
      settled_.push_back(true);
    }
  keep_others(previous, fixed);
}

void Filler::keep_others(const NodeCloud& previous, std::vector<bool> stays) {
  choose_cut(&previous);
  std::vector<bool> lip_stays(previous.size(), false);
  for (int j : kept_lips_)
    lip_stays[j] = true;
  NodeGrid reserved(spacing_.finest(), spacing_.slope);
  for (const CutNode& node : cut_nodes_)
    reserved.add(node.position, node.spacing);
  std::vector<int> removed;
  for (int j = 0; j < previous.size(); ++j) {
    if (stays[j])
      continue;
    const Vector3& x = previous.positions[j];
    const double h = spacing_(x), ratio = previous.spacings[j] / h;
    if (previous.kinds[j] == NodeKind::lip
            ? !lip_stays[j]
            : !still_fits(previous, j, h, ratio) || reserved.crowded(x, h, kept_crowding)) {
      removed.push_back(j);
      continue;
    }
    add(x, h, previous.kinds[j], previous.normals[j]);
    kept_from_.push_back(j);
    settled_.push_back(ratio == 1);
  }
  for (int j : removed) {
    const Vector3& x = previous.positions[j];
    const double h = spacing_(x);
    removed_.add(x, h);
    grid_.for_each_within(x, h, 2 * h, [&](int i, double) { settled_[i] = false; });
  }
}

bool Filler::still_fits(const NodeCloud& previous, int j, double h, double ratio) const {
  const Vector3& x = previous.positions[j];
  const bool grown = ratio < 1, inside = previous.kinds[j] == NodeKind::interior;
  return ratio >= kept_finest && ratio <= kept_coarsest &&
         !grid_.crowded(x, h, grown ? stretched_crowding : kept_crowding) &&
         !(grown && inside && domain_.signed_distance(x) > -options_.wall_clearance * h) &&
         clear_of_sheets(x, kept_clearance * h);
}

std::vector<int> Filler::lips_to_keep(const NodeCloud& previous) const {
  std::vector<int> lips;
  const std::vector<int> partners = lip_partners(previous);
  const auto stays = [&](int j) {
    const Vector3& x = previous.positions[j];
    const double h = spacing_(x), ratio = previous.spacings[j] / h;
    const double reach = 2 * lip_offset * previous.spacings[j];
    return ratio >= kept_finest && ratio <= kept_coarsest && !grid_.crowded(x, h, seeded_crowding) &&
           incision_->closest(x, reach).has_value();
  };
  for (int j = 0; j < previous.size(); ++j)
    if (const int k = partners[j];
        k > j && stays(j) && stays(k) && incision_->blocks(previous.positions[j], previous.positions[k])) {
      lips.push_back(j);
      lips.push_back(k);
    }
  return lips;
}

void Filler::choose_cut(const NodeCloud* previous) {
  if (incision_ == nullptr)
    return;
  if (previous != nullptr)
    kept_lips_ = lips_to_keep(*previous);
  cut_nodes_ =
      choose_cut_nodes(domain_, options_, features_, surface_, layout_, {&grid_, previous, kept_lips_, region_});
}

void Filler::place_cut() {
  if (kept_from_.empty())
    choose_cut(nullptr);
  for (const CutNode& node : cut_nodes_)
    add(node.position, node.spacing, node.kind, node.normal);
}

void Filler::thicken_pieces() {
  if (incision_ == nullptr || size() < 4)
    return;
  const std::vector<SprinklePiece> pieces = inspect_pieces(nodes_, *incision_);
  if (std::none_of(pieces.begin(), pieces.end(), [](const SprinklePiece& piece) { return piece.flat; }))
    return;
  const std::vector<int> piece_of = node_pieces(nodes_, *incision_);
  for (const SurfaceSample& sample : sample_surface(surface_, spacing_, sweep_fraction, options_.maximum_nodes)) {
    const Vector3 x = domain_.closest_surface_point(sample.point);
    const double h = spacing_(x);
    if ((region_ != nullptr && !region_->contains(x)) || !clear_of_sheets(x, thinnest * h))
      continue;
    bool flat = false, crowded = false;
    grid_.for_each_within(x, h, 1.2 * h, [&](int j, double distance) {
      if (crowded || incision_->blocks(x, nodes_.positions[j]))
        return;
      flat |= j < std::ssize(piece_of) && pieces[piece_of[j]].flat;
      crowded |= distance < (nodes_.kinds[j] == NodeKind::lip ? thin_crowding : sweep_crowding) * h;
    });
    if (flat && !crowded)
      add(x, h, NodeKind::surface, domain_.normal(x));
  }
}

} // namespace spherecut::solvers
