// Which functions a cut appends at a sphere: twins in the parts that are hidden from its node, steps where a front ends
// in it.
#include "solvers/appended/cut_space.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <numeric>
#include <utility>

namespace spherecut::solvers {

namespace {

constexpr double faint = 1e-4;        // of a sphere's energy: less of it beyond a cut says nothing of the places there
constexpr double faint_at_rim = 1e-3; // likewise, of all parts together that join nothing: those at its rim
constexpr double level = 1e-8;        // of the square of a step: what it varies by is nothing that nodes can tell

} // namespace

/// The connected components of some parts, numbered from the first part on: that of each, and how many there are. Parts
/// that are marked (none where the list is empty) join nothing, and go with a component that they touch. local_ tells
/// the place of each part when this returns.
int CutSpace::find_components(const std::vector<PartId>& parts, std::vector<int>& component,
                              const std::vector<char>& marked) {
  for (std::size_t k = 0; k < parts.size(); ++k)
    local_[parts[k]] = static_cast<int>(k);
  component.assign(parts.size(), -1);
  const auto is_marked = [&](int place) { return !marked.empty() && marked[place] != 0; };
  int count = 0;
  std::vector<int> pending;
  const auto spread = [&](bool into_marked) {
    for (std::size_t done = 0; done < pending.size(); ++done) {
      const int at = pending[done];
      cut_.for_each_linked(parts[at], [&](PartId next) {
        const int place = local_[next];
        if (place >= 0 && component[place] < 0 && is_marked(place) == into_marked) {
          component[place] = component[at];
          pending.push_back(place);
        }
      });
    }
  };
  for (std::size_t start = 0; start < parts.size(); ++start) {
    if (component[start] >= 0 || is_marked(static_cast<int>(start)))
      continue;
    component[start] = count++;
    pending.assign(1, static_cast<int>(start));
    spread(false);
  }
  if (marked.empty())
    return count;
  pending.clear();
  for (std::size_t k = 0; k < parts.size(); ++k)
    if (component[k] >= 0)
      pending.push_back(static_cast<int>(k));
  spread(true);
  for (std::size_t k = 0; k < parts.size(); ++k) // linked to nothing but others like it
    if (component[k] < 0)
      component[k] = count > 0 ? 0 : (count = 1) - 1;
  return count;
}

// Boxes at the rim of a sphere reach beyond it, and may join around a front outside of it what the cut parts inside.
std::vector<char> CutSpace::faint_of(int node, const std::vector<PartId>& parts) const {
  std::vector<double> energy;
  energy.reserve(parts.size());
  double whole = 0;
  for (const PartId part : parts) {
    energy.push_back(energy_in(node, part));
    whole += energy.back();
  }
  std::vector<std::size_t> faintest(parts.size());
  std::iota(faintest.begin(), faintest.end(), 0);
  std::stable_sort(faintest.begin(), faintest.end(),
                   [&](std::size_t a, std::size_t b) { return energy[a] < energy[b]; });
  std::vector<char> faint_parts(parts.size(), 0);
  double left = faint_at_rim * whole;
  for (const std::size_t k : faintest) {
    left -= energy[k];
    if (left < 0)
      break;
    faint_parts[k] = 1;
  }
  return faint_parts;
}

double CutSpace::energy_in(int node, PartId part) const {
  const int box = box_of(part);
  const BoxShapes& cell = boxes_.cells()[boxes_.cell_of(box)];
  const auto at = std::lower_bound(cell.nodes.begin(), cell.nodes.end(), node);
  if (at == cell.nodes.end() || *at != node)
    return 0;
  return cut_.part(part).share * boxes_.boxes()[box].volume *
         cell.gradient_at(at - cell.nodes.begin(), boxes_.lane_of(box)).squaredNorm();
}

/// Whether the boxes in reach of a sphere hang together without a cut.
bool CutSpace::is_connected(int node) {
  if (connected_[node] >= 0)
    return connected_[node] == 1;
  const std::vector<int>& reach = boxes_.in_reach(node);
  std::vector<char> seen(reach.size(), 0);
  std::vector<int> pending(1, 0);
  seen[0] = 1;
  for (std::size_t done = 0; done < pending.size(); ++done)
    for (const int next : boxes_.neighbours(reach[pending[done]])) {
      const auto at = std::lower_bound(reach.begin(), reach.end(), next);
      if (at == reach.end() || *at != next || std::exchange(seen[at - reach.begin()], 1) != 0)
        continue;
      pending.push_back(static_cast<int>(at - reach.begin()));
    }
  connected_[node] = pending.size() == reach.size() ? 1 : 0;
  return connected_[node] == 1;
}

/// Whether all parts in reach of a sphere hang together, told from those about its divided boxes alone. Every way
/// between boxes that hang together without a cut comes to the neighbours of a divided box before it meets the cut: it
/// is enough that those hang together among themselves. False: not known.
bool CutSpace::hangs_together(int node, const std::vector<int>& divided) {
  if (!is_connected(node))
    return false;
  const std::vector<int>& reach = boxes_.in_reach(node);
  std::vector<PartId> allowed;
  const auto allow = [&](int box) {
    if (local_[part_id(box, 0)] >= 0 || !std::binary_search(reach.begin(), reach.end(), box))
      return;
    for (int k = 0; k < cut_.part_count(box); ++k) {
      local_[part_id(box, k)] = 0;
      allowed.push_back(part_id(box, k));
    }
  };
  for (const int box : divided)
    allow(box);
  std::size_t ring = 0, core = 0; // a ring of neighbours, which have to be joined, and one beyond, which may join them
  for (int round = 0; round < 2; ++round)
    for (core = allowed.size(); ring < core; ++ring)
      for (const int next : boxes_.neighbours(box_of(allowed[ring])))
        allow(next);
  std::vector<PartId> pending(1, allowed.front());
  local_[allowed.front()] = 1;
  for (std::size_t done = 0; done < pending.size(); ++done)
    cut_.for_each_linked(pending[done], [&](PartId next) {
      if (local_[next] == 0) {
        local_[next] = 1;
        pending.push_back(next);
      }
    });
  const bool joined = std::all_of(allowed.begin(), allowed.begin() + static_cast<std::ptrdiff_t>(core),
                                  [&](PartId part) { return local_[part] == 1; });
  for (const PartId part : allowed)
    local_[part] = -1;
  return joined;
}

// Components of the parts in reach of a sphere: its node's own one, and a twin for each of the others. Where all hang
// together although a sheet divides some, the sphere has a step.
void CutSpace::add_twins(int node, std::vector<CutFunction>& found) {
  faint_[node].clear();
  const std::vector<int>& reach = boxes_.in_reach(node);
  std::vector<int> divided;
  std::copy_if(reach.begin(), reach.end(), std::back_inserter(divided), [&](int box) { return cut_.is_divided(box); });
  if (divided.empty())
    return;
  const bool meets_front = incision_->front_frame(spheres_.centres()[node], spheres_.radii()[node]).has_value();
  const bool has_step =
      largest_on_cut(node, divided) >= options_.step_share ||
      (options_.steps_by_run && nodes_.spacings[node] <= options_.step_coarser * spacing_on_cut(node));
  const bool is_whole = meets_front && hangs_together(node, divided);
  if (is_whole && !has_step)
    return;
  std::vector<PartId> parts;
  for (const int box : reach)
    for (int k = 0; k < cut_.part_count(box); ++k)
      parts.push_back(part_id(box, k));
  std::vector<int> component(is_whole ? parts.size() : 0, 0);
  int count = is_whole ? 1 : find_components(parts, component, {});
  if (count == 1 && !meets_front)
    count = find_components(parts, component, faint_of(node, parts));
  for (std::size_t k = 0; k < parts.size(); ++k)
    local_[parts[k]] = static_cast<int>(k);
  const int own_place = local_[cut_.part_at(spheres_.centres()[node], *incision_)];
  const int own = own_place < 0 ? component.front() : component[own_place];
  for (const PartId part : parts)
    local_[part] = -1;
  std::vector<double> energy(static_cast<std::size_t>(count), 0.0);
  double whole = 0;
  for (std::size_t k = 0; k < parts.size() && count > 1; ++k) {
    const double own_share = energy_in(node, parts[k]);
    energy[component[k]] += own_share;
    whole += own_share;
  }
  for (int c = 0; c < count; ++c) {
    if (c == own)
      continue;
    CutFunction function;
    function.twin.node = node;
    for (std::size_t k = 0; k < parts.size(); ++k)
      if (component[k] == c)
        function.twin.hidden.push_back(parts[k]);
    if (energy[c] < faint * whole)
      faint_[node].insert(faint_[node].end(), function.twin.hidden.begin(), function.twin.hidden.end());
    if (energy[c] > 0) // a component in which it has none asks for nothing
      found.push_back(std::move(function));
  }
  std::sort(faint_[node].begin(), faint_[node].end());
  if (!has_step)
    return;
  if (options_.steps_by_run)
    add_run_steps(node, parts, component, count, own, found);
  else if (count == 1 && options_.step_reach > 0)
    add_step(node, std::move(parts), found);
}

/// Whether the sheet of a run lies between parts that hang together around its front. Boxes at runs shorter than
/// `shorter`, m, are taken for its own.
bool CutSpace::is_opened(const std::vector<PartId>& parts, int run, double shorter) {
  for (std::size_t k = 0; k < parts.size(); ++k)
    local_[parts[k]] = static_cast<int>(k);
  const auto is_of_run = [&](int box) {
    const SmallBox& at = boxes_.boxes()[box];
    const auto place = places_.nearest(at.centre);
    const int nearest = place ? places_.runs().run_of(place->segment) : -1;
    return nearest >= 0 && (nearest == run || places_.runs().length(nearest) < shorter);
  };
  bool is_open = false;
  for (const PartId part : parts) {
    const int box = box_of(part);
    if (!cut_.is_divided(box))
      continue;
    bool has_both = false;
    for (int other = part % most_parts + 1; other < cut_.part_count(box) && !has_both; ++other)
      has_both = local_[part_id(box, other)] >= 0;
    for (const int neighbour : boxes_.neighbours(box))
      for (int other = 0; other < cut_.part_count(neighbour) && !has_both; ++other)
        has_both = local_[part_id(neighbour, other)] >= 0 &&
                   incision_->blocks(cut_.part(part).eye, cut_.part(part_id(neighbour, other)).eye);
    if (has_both && is_of_run(box)) {
      is_open = true;
      break;
    }
  }
  for (const PartId part : parts)
    local_[part] = -1;
  return is_open;
}

/// Whether psi of a step is anything but one number over its parts: else the step repeats the sphere, or its twin.
bool CutSpace::varies(const Twin& twin) const {
  const double spacing = nodes_.spacings[twin.node];
  double whole = 0, first = 0, second = 0, sloping = 0; // weighed by the energy of the sphere, of psi and of psi^2
  for (const PartId part : twin.hidden) {
    const double energy = energy_in(twin.node, part);
    if (energy == 0)
      continue;
    const PlacedPart& samples = places_.of(cut_, part);
    for (std::size_t n = 0; n < samples.size(); ++n) {
      Vector3 slope;
      const std::optional<double> jump = jump_at(twin, part, static_cast<int>(n), slope);
      if (!jump)
        continue;
      const double weight = samples[n].share * energy;
      whole += weight;
      first += weight * *jump;
      second += weight * *jump * *jump;
      sloping += weight * spacing * spacing * slope.squaredNorm();
    }
  }
  return second * whole - first * first + sloping * whole > level * whole * whole;
}

/// Steps behind the front of every run that ends in the sphere of a node: in its node's own component, and in each of
/// those with a twin.
void CutSpace::add_run_steps(int node, const std::vector<PartId>& parts, const std::vector<int>& component, int count,
                             int own, std::vector<CutFunction>& found) {
  const Vector3& x = spheres_.centres()[node];
  const double radius = spheres_.radii()[node];
  if (!incision_->closest(x, radius))
    return;
  std::vector<std::pair<int, FrontPlace>> near;
  bool has_long = false;
  double least = options_.short_run * nodes_.spacings[node];
  for (int run = 0; run < places_.runs().count(); ++run)
    if (const auto place = places_.runs().place(run, x, (count == 1 ? 2 : 1) * radius)) {
      near.emplace_back(run, *place);
      has_long = has_long || (places_.runs().length(run) >= least && place->distance < radius);
    }
  if (!has_long)
    least = 0;
  std::erase_if(near, [&](const auto& of) { return places_.runs().length(of.first) < least; });
  for (const auto& [run, place] : near) {
    const bool alone = count == 1 && places_.runs().count() == 1;
    for (int c = 0; c < count; ++c) {
      CutFunction function;
      Twin& twin = function.twin;
      for (std::size_t k = 0; k < parts.size(); ++k)
        if (component[k] == c)
          twin.hidden.push_back(parts[k]);
      if (!alone && !is_opened(twin.hidden, run, least))
        continue;
      twin.node = node;
      twin.is_step = true;
      twin.run = run;
      twin.step_length = options_.step_reach * nodes_.spacings[node];
      Vector3 gradient;
      twin.step_at_node = c == own ? step(&place, x, twin.step_length, gradient) : 1;
      if (varies(twin))
        found.push_back(std::move(function));
    }
  }
}

/// The step of a sphere in which the front ends, or beside which it passes, where its run is curved; of one that a
/// straight front ends in, where no function along the front carries its node.
void CutSpace::add_step(int node, std::vector<PartId> parts, std::vector<CutFunction>& found) const {
  const Vector3& x = spheres_.centres()[node];
  const double radius = spheres_.radii()[node];
  const auto nearest = incision_->front_frame(x, 2 * radius);
  if (!nearest || !incision_->closest(x, radius))
    return;
  // The functions along the front carry the nodes about it alone: a sphere that reaches it from beyond knows no
  // opening.
  const bool from_beyond = nearest->distance > carried_[nearest->segment] && nearest->distance < radius;
  if (curved_[nearest->segment] == 0 && !from_beyond)
    return;
  CutFunction function;
  Twin& twin = function.twin;
  twin.node = node;
  twin.is_step = true;
  twin.hidden = std::move(parts);
  twin.step_length = options_.step_reach * nodes_.spacings[node];
  const auto at = places_.nearest(x);
  Vector3 gradient;
  twin.step_at_node = step(at ? &*at : nullptr, x, twin.step_length, gradient);
  found.push_back(std::move(function));
}

/// The largest value of the shape function of a node at boxes that the cut divides.
double CutSpace::largest_on_cut(int node, const std::vector<int>& divided) const {
  double largest = 0;
  for (const int box : divided) {
    const BoxShapes& cell = boxes_.cells()[boxes_.cell_of(box)];
    const auto at = std::lower_bound(cell.nodes.begin(), cell.nodes.end(), node);
    if (at != cell.nodes.end() && *at == node)
      largest = std::max(largest, std::abs(cell.value_at(at - cell.nodes.begin(), boxes_.lane_of(box))));
  }
  return largest;
}

/// m, of the node nearest to the place on the cut that is nearest to a node; 0: the cut is not in its sphere.
double CutSpace::spacing_on_cut(int node) const {
  const auto on_cut = incision_->closest(spheres_.centres()[node], spheres_.radii()[node]);
  double nearest = std::numeric_limits<double>::infinity(), spacing = 0;
  if (on_cut)
    for (const int other : spheres_.candidates(on_cut->point))
      if (const double distance = (spheres_.centres()[other] - on_cut->point).norm(); distance < nearest) {
        nearest = distance;
        spacing = nodes_.spacings[other];
      }
  return spacing;
}

// A run of the front is curved where it turns by more than step_turn within a sphere, over most of its length; corners,
// such as that of a blade, are not counted. A cut that is shallow behind its front counts as well.
void CutSpace::find_curved_front() {
  const double most = options_.step_turn * std::numbers::pi / 180, corner = options_.corner * std::numbers::pi / 180;
  const std::vector<topology::FrontSegment>& front = incision_->front();
  std::vector<Vector3> middle, ahead;
  std::vector<double> radius; // of the largest sphere about a segment
  middle.reserve(front.size());
  ahead.reserve(front.size());
  radius.reserve(front.size());
  carried_.clear();
  carried_.reserve(front.size());
  for (int s = 0; s < std::ssize(front); ++s) {
    const Vector3 x = 0.5 * (front[s].from + front[s].to);
    middle.push_back(x);
    ahead.push_back(incision_->front_frame_at(s, 0.5).ahead);
    double largest = 0, nearest = std::numeric_limits<double>::infinity(), spacing = 0;
    for (const int node : spheres_.candidates(x)) {
      const double distance = (spheres_.centres()[node] - x).norm();
      if (distance < spheres_.radii()[node])
        largest = std::max(largest, spheres_.radii()[node]);
      if (distance < nearest) {
        nearest = distance;
        spacing = nodes_.spacings[node];
      }
    }
    radius.push_back(largest);
    carried_.push_back(options_.front.radius * spacing);
  }
  curved_.assign(front.size(), 0);
  for (const FrontRun& run : places_.runs().runs()) {
    const int count = static_cast<int>(run.segments.size());
    const auto turning = [&](int k, int step) {
      double turned = 0;
      const int start = run.segments[k];
      for (int walked = 1, at = k; walked < count; ++walked) {
        int next = at + step;
        if (run.closed)
          next = (next + count) % count;
        else if (next < 0 || next >= count)
          break;
        const int here = run.segments[at], there = run.segments[next];
        if ((middle[there] - middle[start]).norm() >= radius[start])
          break;
        const double angle = std::acos(std::clamp(ahead[here].dot(ahead[there]), -1.0, 1.0));
        turned += angle < corner ? angle : 0;
        at = next;
      }
      return turned;
    };
    double length = 0, curved = 0;
    for (int k = 0; k < count; ++k) {
      const topology::FrontSegment& segment = front[run.segments[k]];
      const double own = (segment.to - segment.from).norm();
      length += own;
      const int at = run.segments[k];
      const Vector3 behind = middle[at] - options_.shallow * radius[at] * ahead[at];
      const bool is_shallow =
          domain_.signed_distance(behind) > 0 || !incision_->closest(behind, 0.5 * options_.shallow * radius[at]);
      curved += is_shallow || std::max(turning(k, 1), turning(k, -1)) > most ? own : 0;
    }
    for (const int s : run.segments)
      curved_[s] = curved > 0.5 * length ? 1 : 0;
  }
}

} // namespace spherecut::solvers
