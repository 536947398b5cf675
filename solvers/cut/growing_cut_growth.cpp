// One increment of a growing cut: what it exchanges is found first, while all can still stay as it is, then exchanged
// in the window, then condensed onto the contact.
#include "solvers/cut/growing_cut_state.hpp"

namespace spherecut::solvers {

class GrowingCut::Growth {
 public:
  Growth(GrowingCut& cut, const NodeChange& change, const std::shared_ptr<const topology::Incision>& incision,
         const std::function<topology::SurfaceMesh()>& way_ahead, bool only_update)
      : cut_(cut), s_(*cut.state_), change_(change), way_ahead_(way_ahead), only_update_(only_update),
        increment_(s_.increment(change, incision)) {
    report_.spheres_seconds = increment_.spheres_seconds;
  }

  GrowthReport run() {
    const char* outside = increment_.uncovered;
    if (outside == nullptr)
      outside = evaluate();
    if (outside != nullptr)
      return anew(outside, std::move(increment_.next), std::move(increment_.removed), false);
    exchange();
    try {
      condense();
    } catch (const NumericalError&) {
      return condense_in_full();
    }
    report_.window_nodes = static_cast<int>(
        std::count_if(s_.window_node.begin(), s_.window_node.end(), [](int node) { return node >= 0; }));
    report_.total_seconds = total_.seconds();
    return report_;
  }

 private:
  GrowthReport anew(const char* reason, Problem problem, std::vector<char> removed, bool is_overwritten);
  const char* evaluate();
  void find_surface_changes();
  [[nodiscard]] bool is_reshaped(const DisplacementMean& mean, int node) const;
  void find_held();
  void exchange();
  void exchange_cells();
  void condense();
  void reweigh_contact();
  GrowthReport condense_in_full();

  [[nodiscard]] bool leaves_window(const State::Box& box) const {
    for (const CellShapes& cell : box.cells)
      for (int node : cell.nodes)
        if (new_slot_[node] < 0)
          return true;
    return false;
  }

  GrowingCut& cut_;
  State& s_;
  const NodeChange& change_;
  const std::function<topology::SurfaceMesh()>& way_ahead_;
  const bool only_update_;
  Stopwatch total_;
  State::Increment increment_;
  GrowthReport report_;
  std::vector<int> new_slot_;          // with those of the added nodes
  std::vector<State::Box> fresh_;      // the touched boxes after it
  std::vector<DisplacementMean> held_; // means of what is held after it
  std::vector<HeldChange> held_changes_;
  std::unique_ptr<Shares> shares_; // null: not needed so far
  // Places near which shares of the surface change.
  std::optional<Nearness> to_skin_changes_, to_lip_changes_, to_faces_;
  // Of the body before, for condense_in_full().
  Problem previous_;
  std::vector<char> previously_removed_;
  std::vector<int> previous_candidates_;
};

/// The body of `problem`, condensed from nothing; `is_overwritten`: the state is not what it was before.
GrowthReport GrowingCut::Growth::anew(const char* reason, Problem problem, std::vector<char> removed,
                                      bool is_overwritten) {
  report_.reason = reason;
  if (only_update_ && !is_overwritten) {
    report_.declined = true;
    return report_;
  }
  auto fresh = std::make_unique<State>(std::move(problem), s_.options);
  fresh->removed = std::move(removed);
  if (way_ahead_ && !is_overwritten) // it may look at the body as it was
    if (topology::SurfaceMesh way = way_ahead_(); !way.triangles.empty())
      fresh->options.way = std::move(way);
  fresh->condense_all();
  const State& condensed = *(cut_.state_ = std::move(fresh));
  report_.condensed_anew = true;
  report_.window_nodes = condensed.window->slots() / 3 - condensed.options.room;
  report_.total_seconds = total_.seconds();
  return report_;
}

/// What comes in place of what the increment touches; the state stays as it is. Why the window does not hold all of it;
/// null: it does.
const char* GrowingCut::Growth::evaluate() {
  constexpr const char* left_way = "the cut left the predicted way";
  new_slot_ = s_.slot;
  for (int k = 0; k < change_.added.size(); ++k)
    new_slot_.push_back(s_.next_room + k);
  for (const int box : increment_.boxes) // before anything is evaluated in vain
    if (leaves_window(s_.boxes[box]))
      return left_way;
  fresh_ = s_.evaluated(increment_);
  const char* outside = nullptr;
  for (const State::Box& box : fresh_)
    if (leaves_window(box))
      outside = left_way;
  find_surface_changes();
  find_held();
  for (const HeldChange& one : held_changes_)
    for (const DisplacementMean* mean :
         {one.before < 0 ? nullptr : &s_.held[one.before], one.now < 0 ? nullptr : &held_[one.now]})
      if (mean != nullptr)
        for (int node : mean->nodes)
          if (new_slot_[node] < 0)
            outside = "the cut came to the held region";
  return outside;
}

/// Means over the surface whose points see the change have new weights, and where the faces or surface nodes come near
/// the shares themselves are new.
void GrowingCut::Growth::find_surface_changes() {
  const std::vector<Vector3>& faces = increment_.changes.faces;
  std::vector<Vector3> skin_changes, lip_changes = faces;
  const auto add = [&](NodeKind kind, const Vector3& x) {
    if (kind == NodeKind::interior)
      return;
    lip_changes.push_back(x); // the points of faces go by the spacing of whatever is nearest
    if (kind != NodeKind::lip)
      skin_changes.push_back(x);
  };
  for (int node : change_.removed)
    add(s_.problem.nodes.kinds[node], s_.problem.nodes.positions[node]);
  for (int k = 0; k < change_.added.size(); ++k)
    add(change_.added.kinds[k], change_.added.positions[k]);
  to_skin_changes_.emplace(skin_changes);
  to_lip_changes_.emplace(lip_changes);
  to_faces_.emplace(faces);
}

/// Whether the share of `node` itself is new.
bool GrowingCut::Growth::is_reshaped(const DisplacementMean& mean, int node) const {
  const NodeCloud& nodes = s_.problem.nodes;
  const double spacing = nodes.spacings[node];
  if (nodes.kinds[node] == NodeKind::lip)
    return (*to_lip_changes_)(mean.centroid) < share_size * spacing;
  if ((*to_skin_changes_)(mean.centroid) < share_size * spacing)
    return true;
  // New faces take points away from a node, or give it those of a neighbour, where they come into its share.
  double extent = spacing;
  for (const QuadraturePoint& point : mean.share)
    extent = std::max(extent, (point.position - nodes.positions[node]).norm());
  return (*to_faces_)(nodes.positions[node]) < share_crossing * extent;
}

/// The means of what is held, and which of them change.
void GrowingCut::Growth::find_held() {
  const Problem& next = increment_.next;
  const std::vector<Prescribed>& before = s_.problem.prescribed;
  held_ = s_.held;
  bool reshaped = !std::equal(
      next.prescribed.begin(), next.prescribed.end(), before.begin(), before.end(),
      [](const Prescribed& a, const Prescribed& b) { return a.node == b.node && a.components == b.components; });
  for (std::size_t k = 0; k < held_.size() && !reshaped; ++k)
    reshaped = is_reshaped(held_[k], before[k].node);
  if (reshaped) {
    shares_ = std::make_unique<Shares>(next, increment_.removed);
    held_ = held_means(next, *increment_.spheres, *shares_);
  } else {
    for (DisplacementMean& mean : held_)
      if (s_.is_concerned(mean, increment_))
        if (DisplacementMean weighed = reweighed(mean, *increment_.spheres); !equal_to_rounding(mean, weighed))
          mean = std::move(weighed);
  }
  held_changes_ = solvers::held_changes(before, s_.held, next.prescribed, held_);
}

/// The state becomes that after the increment, but for what is factored and condensed.
void GrowingCut::Growth::exchange() {
  s_.find_altered(increment_);
  Problem& next = increment_.next;
  s_.cell_loads.conservativeResizeLike(VectorX::Zero(3 * static_cast<Eigen::Index>(next.nodes.size())));
  std::vector<int> come_slots, gone_slots;
  for (int k = 0; k < change_.added.size(); ++k) {
    const int block = s_.next_room + k;
    come_slots.insert(come_slots.end(), {3 * block, 3 * block + 1, 3 * block + 2});
    s_.window_node[block] = s_.problem.nodes.size() + k;
  }
  s_.window->activate(come_slots);
  s_.next_room += change_.added.size();
  s_.slot = std::move(new_slot_);
  exchange_cells();
  for (const HeldChange& one : held_changes_) {
    if (one.before >= 0)
      s_.scatter(s_.held[one.before], s_.problem, s_.problem.prescribed[one.before], -1);
    if (one.now >= 0)
      s_.scatter(held_[one.now], next, next.prescribed[one.now], 1);
  }
  s_.held = std::move(held_);
  for (int node : change_.removed) {
    for (int c = 0; c < 3; ++c)
      gone_slots.push_back(3 * s_.slot[node] + c);
    s_.window_node[s_.slot[node]] = -1;
    s_.cell_loads.segment<3>(3 * static_cast<Eigen::Index>(node)).setZero();
  }
  s_.window->deactivate(gone_slots);
  previous_ = std::move(s_.problem);
  previously_removed_ = std::move(s_.removed);
  previous_candidates_ = s_.options.contact;
  s_.problem = std::move(next);
  s_.removed = std::move(increment_.removed);
  s_.spheres = std::move(increment_.spheres);
  s_.shares = std::move(shares_);
  s_.lip_shares.reset();
  s_.means.clear(); // where lip nodes are sparse a share reaches farther than can be told from its node
  report_.boxes = static_cast<int>(increment_.boxes.size());
}

void GrowingCut::Growth::exchange_cells() {
  std::vector<const CellShapes*> gone, come;
  for (std::size_t k = 0; k < fresh_.size(); ++k)
    State::find_changed(s_.boxes[increment_.boxes[k]], fresh_[k], gone, come);
  StiffnessTiles tiles(increment_.next.nodes.positions);
  tiles.add_all(gone, -1);
  tiles.add_all(come, 1);
  s_.scatter(tiles);
  for (std::size_t k = 0; k < fresh_.size(); ++k) {
    State::Box &old = s_.boxes[increment_.boxes[k]], &box = fresh_[k];
    s_.add_cell_loads(old, -1, *s_.spheres, s_.cell_loads);
    if (box.exchanged = true; old.exchanged)
      box.first = std::move(old.first);
    else
      box.first = std::move(old.cells);
    old = std::move(box);
    s_.add_cell_loads(old, 1, *increment_.spheres, s_.cell_loads);
  }
}

/// Factors the window and condenses onto the contact. Throws NumericalError.
void GrowingCut::Growth::condense() {
  s_.find_loads();
  report_.cells_seconds = total_.seconds() - report_.spheres_seconds;
  const Stopwatch factor_watch;
  std::vector<Vector3> places = increment_.changes.faces;
  places.insert(places.end(), increment_.changes.front.begin(), increment_.changes.front.end());
  report_.prepared = s_.factor_window(places);
  report_.factored = s_.window->factored();
  report_.factor_seconds = factor_watch.seconds();
  const Stopwatch condense_watch;
  s_.drop_removed_contact();
  reweigh_contact();
  for (const DisplacementMean& mean : s_.contact)
    for (const int node : mean.nodes)
      if (s_.slot[node] < 0)
        throw NumericalError("the cut came to the contact outside the window"); // condensed anew then
  s_.condense_contact();
  report_.condense_seconds = condense_watch.seconds();
}

void GrowingCut::Growth::reweigh_contact() {
  const NodeCloud& nodes = s_.problem.nodes;
  std::vector<Vector3> reshaped_places;
  for (std::size_t c = 0; c < s_.contact.size(); ++c)
    if (is_reshaped(s_.contact[c], s_.options.contact[c]))
      reshaped_places.push_back(nodes.positions[s_.options.contact[c]]);
  // What a share loses goes to one beside it.
  const Nearness to_reshaped(reshaped_places);
  std::vector<std::size_t> reshaped_contact;
  for (std::size_t c = 0; c < s_.contact.size(); ++c) {
    const int node = s_.options.contact[c];
    if (to_reshaped(nodes.positions[node]) < share_size * nodes.spacings[node])
      reshaped_contact.push_back(c);
    else if (s_.is_concerned(s_.contact[c], increment_))
      s_.contact[c] = reweighed(s_.contact[c], *s_.spheres);
  }
  s_.find_contact(reshaped_contact);
}

/// A piece that nothing holds, or a support gone bad: the ordinary way deals with it or says what is wrong; then the
/// body before is condensed again, for this one has been overwritten.
GrowthReport GrowingCut::Growth::condense_in_full() {
  try {
    return anew("the window became singular", s_.problem, s_.removed, true);
  } catch (...) {
    auto back = std::make_unique<State>(std::move(previous_), s_.options);
    back->removed = std::move(previously_removed_);
    back->options.contact = previous_candidates_;
    back->condense_all();
    cut_.state_ = std::move(back);
    throw;
  }
}

GrowthReport GrowingCut::grow(const NodeChange& change, const std::shared_ptr<const topology::Incision>& incision,
                              const std::function<topology::SurfaceMesh()>& way_ahead, bool only_update) {
  return Growth(*this, change, incision, way_ahead, only_update).run();
}

} // namespace spherecut::solvers
