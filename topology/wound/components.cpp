// Which parts of a wound's surface are connected, and which material they bound.
#include "topology/wound/assembly.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <numeric>

namespace spherecut::topology {

namespace {

int root(std::vector<int>& group, int i) {
  while (group[i] != i)
    i = group[i] = group[group[i]];
  return i;
}

void join(std::vector<int>& group, int a, int b) {
  a = root(group, a);
  b = root(group, b);
  group[std::max(a, b)] = std::min(a, b);
}

} // namespace

void WoundAssembly::update_components(const Region& region) {
  const std::vector<int> halves = halves_of(region.facets);
  const auto empty = [](const WoundComponent& component) { return component.triangles == 0; };
  if (!keep_components(halves)) {
    label_all();
    return;
  }
  for (const int half : halves)
    for (const int t : output_[half].triangles) {
      if (t < 0)
        continue;
      const int label = output_[half].component;
      wound_.component[t] = label;
      wound_.components[label].volume += tetrahedron(t);
      ++wound_.components[label].triangles;
      for (const int v : wound_.surface.triangles[t])
        if (vertex_component_[v] < 0) {
          vertex_component_[v] = label;
          ++vertex_count_[label];
        }
    }
  if (std::any_of(wound_.components.begin(), wound_.components.end(), empty)) {
    label_all();
    return;
  }
  for (std::size_t c = 0; c < wound_.components.size(); ++c)
    wound_.components[c].euler = vertex_count_[c] - wound_.components[c].triangles / 2;
  sum_pieces();
}

/// Gives the rebuilt halves the labels of what they join, when that leaves the components as they are: every patch of
/// them joins exactly one, and patches that join the same one are still linked outside. False otherwise.
bool WoundAssembly::keep_components(const std::vector<int>& halves) {
  std::vector<int> group(halves.size());
  std::iota(group.begin(), group.end(), 0);
  const auto index_of = [&](int half) {
    const auto found = std::lower_bound(halves.begin(), halves.end(), half);
    return found != halves.end() && *found == half ? static_cast<int>(found - halves.begin()) : -1;
  };
  std::vector<std::pair<int, int>> border; // index, half beyond
  for (int i = 0; i < std::ssize(halves); ++i)
    for (const int beyond : across_[halves[i]]) {
      const int j = index_of(beyond);
      if (j >= 0)
        join(group, i, j);
      else
        border.emplace_back(i, beyond);
    }
  std::vector<int> label(halves.size(), -1); // by root
  for (const auto& [i, beyond] : border) {
    int& mine = label[root(group, i)];
    const int theirs = output_[beyond].component;
    if (mine >= 0 && mine != theirs)
      return false;
    mine = theirs;
  }
  std::map<int, std::vector<int>> patches; // by label
  for (int i = 0; i < std::ssize(halves); ++i)
    if (root(group, i) == i) {
      if (label[i] < 0)
        return false;
      patches[label[i]].push_back(i);
    }
  // Searches from all patches with one label take turns until they have met, or one has nowhere left to go.
  for (const auto& patch_list : patches) {
    const std::vector<int>& roots = patch_list.second;
    if (roots.size() < 2)
      continue;
    std::vector<int> met(roots.size());
    std::iota(met.begin(), met.end(), 0);
    std::unordered_map<int, int> reached;
    std::vector<std::vector<int>> open(roots.size());
    const auto visit = [&](int half, int search) {
      const auto [found, fresh] = reached.emplace(half, search);
      if (fresh)
        open[search].push_back(half);
      else
        join(met, found->second, search);
    };
    for (const auto& [i, beyond] : border) {
      const auto patch = std::find(roots.begin(), roots.end(), root(group, i));
      if (patch != roots.end())
        visit(beyond, static_cast<int>(patch - roots.begin()));
    }
    std::vector<std::size_t> next(roots.size(), 0); // breadth first
    const auto apart = [&] {
      for (int s = 1; s < std::ssize(roots); ++s)
        if (root(met, s) != 0)
          return true;
      return false;
    };
    constexpr int turn = 64;
    while (apart()) {
      std::vector<bool> going(roots.size(), false);
      for (int s = 0; s < std::ssize(roots); ++s) {
        for (int k = 0; k < turn && next[s] < open[s].size(); ++k) {
          const int from = open[s][next[s]++];
          for (const int beyond : across_[from])
            if (index_of(beyond) < 0)
              visit(beyond, s);
        }
        if (next[s] < open[s].size())
          going[root(met, s)] = true;
      }
      for (int s = 0; s < std::ssize(roots); ++s)
        if (going[s])
          going[root(met, s)] = true;
      for (int s = 0; s < std::ssize(roots); ++s)
        if (root(met, s) == s && !going[s] && apart())
          return false;
    }
  }
  for (int i = 0; i < std::ssize(halves); ++i)
    output_[halves[i]].component = label[root(group, i)];
  return true;
}

void WoundAssembly::label_all() {
  const int triangles = static_cast<int>(wound_.surface.triangles.size());
  wound_.components.clear();
  vertex_count_.clear();
  for (const int half : half_of_)
    output_[half].component = -1;
  std::fill(vertex_component_.begin(), vertex_component_.end(), -1);
  std::vector<int> open;
  for (int first = 0; first < triangles; ++first) {
    if (output_[half_of_[first]].component >= 0)
      continue;
    const int label = static_cast<int>(wound_.components.size());
    wound_.components.emplace_back();
    vertex_count_.push_back(0);
    open = {half_of_[first]};
    output_[open.front()].component = label;
    while (!open.empty()) {
      const int half = open.back();
      open.pop_back();
      for (const int beyond : across_[half])
        if (output_[beyond].component < 0) {
          output_[beyond].component = label;
          open.push_back(beyond);
        }
    }
  }
  std::vector<bool> flat(wound_.components.size(), true); // every wall faces itself: encloses nothing, exactly
  for (int t = 0; t < triangles; ++t) {
    const int half = half_of_[t], label = output_[half].component;
    wound_.component[t] = label;
    WoundComponent& component = wound_.components[label];
    component.volume += tetrahedron(t);
    ++component.triangles;
    for (const int v : wound_.surface.triangles[t])
      if (vertex_component_[v] < 0) {
        vertex_component_[v] = label;
        ++vertex_count_[label];
      }
    if (arrangement_.on_surface(half / 2) || output_[half ^ 1].component != label)
      flat[label] = false;
  }
  for (std::size_t c = 0; c < wound_.components.size(); ++c) {
    WoundComponent& component = wound_.components[c];
    component.euler = vertex_count_[c] - component.triangles / 2;
    if (flat[c])
      component.volume = 0;
  }
  assign_pieces(flat);
}

void WoundAssembly::assign_pieces(const std::vector<bool>& flat) {
  std::vector<WoundComponent>& components = wound_.components;
  std::vector<int> group(components.size());
  std::iota(group.begin(), group.end(), 0);
  // A cavity belongs to the material that a ray from its largest wall runs through.
  std::vector<int> widest(components.size(), -1);
  std::vector<double> area(components.size(), -1);
  for (int t = 0; t < std::ssize(wound_.surface.triangles); ++t) {
    const int c = wound_.component[t];
    if (!flat[c] && components[c].volume > 0)
      continue;
    const auto& [i, j, k] = wound_.surface.triangles[t];
    const std::vector<Vector3>& x = wound_.surface.vertices;
    const double size = (x[j] - x[i]).cross(x[k] - x[i]).norm();
    if (size > area[c]) {
      area[c] = size;
      widest[c] = half_of_[t];
    }
  }
  for (const int half : widest)
    if (half >= 0)
      join_along_ray(half, group);
  int pieces = 0;
  std::vector<int> piece(components.size(), -1);
  for (int c = 0; c < std::ssize(components); ++c) {
    int& number = piece[root(group, c)];
    if (number < 0)
      number = pieces++;
    components[c].piece = number;
  }
  wound_.pieces.resize(pieces);
  sum_pieces();
}

/// Follows a ray from the middle of a wall into its material, out through the whole organ, and joins the components
/// between which it runs through material.
void WoundAssembly::join_along_ray(int half, std::vector<int>& group) {
  const bool before_normal = half % 2 == 1; // the material lies on the + side
  int last = half;                          // bounds the material that the ray is in; -1 outside
  for (const auto& [facet, along_normal] : arrangement_.ray_from(half / 2, before_normal)) {
    const int behind = 2 * facet, before = arrangement_.on_surface(facet) ? -1 : 2 * facet + 1;
    const int met = along_normal ? behind : before;
    if (last >= 0 && met >= 0)
      join(group, output_[last].component, output_[met].component);
    last = along_normal ? before : behind;
  }
}

void WoundAssembly::sum_pieces() {
  for (WoundPiece& piece : wound_.pieces)
    piece = {};
  for (const WoundComponent& component : wound_.components) {
    WoundPiece& piece = wound_.pieces[component.piece];
    piece.volume += component.volume;
    piece.triangles += component.triangles;
    piece.euler += component.euler;
    ++piece.components;
  }
}

} // namespace spherecut::topology
