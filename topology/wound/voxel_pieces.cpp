#include "topology/wound/voxel_pieces.hpp"

#include "topology/domain/voxel_centre.inl"
#include "topology/search/disjoint_sets.hpp"
#include "topology/search/proximity.hpp"

#include <algorithm>
#include <cmath>
#include <openvdb/openvdb.h>
#include <openvdb/tools/LevelSetUtil.h>
#include <openvdb/tools/Prune.h>

namespace spherecut::topology {

namespace {

/// Voxels inside the body within `reach` m of a sheet.
std::vector<openvdb::Coord> near_sheets(const openvdb::BoolTree& inside, const Incision& incision, double voxel,
                                        double reach) {
  openvdb::BoolTree near(false);
  openvdb::tree::ValueAccessor<openvdb::BoolTree> accessor(near);
  const openvdb::tree::ValueAccessor<const openvdb::BoolTree> in_body(inside);
  for (const SurfaceMesh& sheet : incision.sheets())
    for (const Triangle& t : sheet.triangles) {
      const Vector3 &a = sheet.vertices[t[0]], &b = sheet.vertices[t[1]], &c = sheet.vertices[t[2]];
      const Vector3 lower = (a.cwiseMin(b).cwiseMin(c).array() - reach) / voxel;
      const Vector3 upper = (a.cwiseMax(b).cwiseMax(c).array() + reach) / voxel;
      openvdb::Coord at, from, to;
      for (int d = 0; d < 3; ++d) {
        from[d] = static_cast<int>(std::ceil(lower[d]));
        to[d] = static_cast<int>(std::floor(upper[d]));
      }
      for (at.x() = from.x(); at.x() <= to.x(); ++at.x())
        for (at.y() = from.y(); at.y() <= to.y(); ++at.y())
          for (at.z() = from.z(); at.z() <= to.z(); ++at.z())
            if (const Vector3 x = centre(at, voxel); in_body.isValueOn(at) && !accessor.isValueOn(at) &&
                                                     (closest_on_triangle(x, a, b, c).point - x).norm() <= reach)
              accessor.setValueOn(at);
    }
  std::vector<openvdb::Coord> voxels;
  for (auto it = near.cbeginValueOn(); it; ++it)
    voxels.push_back(it.getCoord());
  return voxels;
}

} // namespace

VoxelPieces count_pieces(const LevelSet& organ, const Incision& incision, int fewest_voxels, bool with_skins) {
  openvdb::initialize();
  const double voxel = organ.voxel_size();
  openvdb::BoolTree inside(false);
  organ.visit_inside([&](const std::array<int, 3>& lower, const std::array<int, 3>& upper) {
    inside.fill(openvdb::CoordBBox(lower[0], lower[1], lower[2], upper[0], upper[1], upper[2]), true);
  });
  // Of two voxels whose centres a sheet parts, diagonal neighbours included, one lies at least this near to it.
  const std::vector<openvdb::Coord> near = near_sheets(inside, incision, voxel, 0.5 * std::sqrt(3.0) * voxel);
  openvdb::BoolTree clear(inside);
  for (const openvdb::Coord& at : near)
    clear.setValueOff(at, false);
  openvdb::tools::prune(clear);
  std::vector<openvdb::BoolTree::Ptr> floods;
  openvdb::tools::segmentActiveVoxels(clear, floods);

  // Piece of every voxel near a sheet and of the neighbours of these: 0 is none.
  DisjointSets pieces; // by their numbers
  pieces.add();
  std::vector<double> counts{0};
  for (const auto& flood : floods) {
    pieces.add();
    counts.push_back(static_cast<double>(flood->activeVoxelCount()));
  }
  openvdb::Int32Tree labels(0);
  openvdb::tree::ValueAccessor<openvdb::Int32Tree> label(labels);
  for (const openvdb::Coord& at : near) {
    label.setValueOn(at, pieces.add());
    counts.push_back(1);
  }
  const auto piece_of = [&](const openvdb::Coord& at) {
    if (const int known = label.getValue(at))
      return known;
    for (std::size_t f = 0; f < floods.size(); ++f)
      if (floods[f]->isValueOn(at)) {
        label.setValueOn(at, static_cast<int>(f) + 1);
        return static_cast<int>(f) + 1;
      }
    return 0;
  };
  for (const openvdb::Coord& at : near)
    for (int d = 0; d < 3; ++d)
      for (const int side : {-1, 1}) {
        openvdb::Coord beside = at;
        beside[d] += side;
        if (!inside.isValueOn(beside))
          continue;
        const int other = piece_of(beside), self = label.getValue(at);
        if (pieces.find(other) != pieces.find(self) && !incision.blocks(centre(at, voxel), centre(beside, voxel)))
          pieces.join(other, self);
      }

  std::vector<double> totals(counts.size(), 0);
  for (int i = 1; i < pieces.size(); ++i)
    totals[pieces.find(i)] += counts[i];
  VoxelPieces result;
  const double volume = std::pow(voxel, 3);
  std::vector<int> kept; // numbers of the pieces, largest first
  for (int i = 1; i < pieces.size(); ++i)
    if (totals[i] >= fewest_voxels)
      kept.push_back(i);
    else
      result.crumbs += totals[i] * volume;
  std::stable_sort(kept.begin(), kept.end(), [&](int a, int b) { return totals[a] > totals[b]; });
  for (const int piece : kept)
    result.volumes.push_back(totals[piece] * volume);
  if (!with_skins)
    return result;
  std::vector<int> place(pieces.size(), -1);
  for (std::size_t k = 0; k < kept.size(); ++k)
    place[kept[k]] = static_cast<int>(k);
  result.skins.resize(kept.size());
  for (auto voxels = inside.cbeginValueOn(); voxels; ++voxels) {
    const openvdb::CoordBBox box = voxels.getBoundingBox(); // of one voxel, or of a tile
    const Vector3 lower = centre(box.min(), voxel), upper = centre(box.max(), voxel);
    const bool uncut = !incision.near(0.5 * (lower + upper), 0.5 * (upper - lower).norm() + voxel);
    openvdb::Coord at;
    for (at.x() = box.min().x(); at.x() <= box.max().x(); ++at.x())
      for (at.y() = box.min().y(); at.y() <= box.max().y(); ++at.y())
        for (at.z() = box.min().z(); at.z() <= box.max().z(); ++at.z())
          for (int d = 0; d < 3; ++d)
            for (const int side : {-1, 1}) {
              openvdb::Coord beside = at;
              beside[d] += side;
              const bool in_body = inside.isValueOn(beside);
              if (uncut && in_body && box.isInside(beside))
                continue;
              const int own = pieces.find(piece_of(at));
              if (place[own] < 0 || (in_body && pieces.find(piece_of(beside)) == own &&
                                     !incision.blocks(centre(at, voxel), centre(beside, voxel))))
                continue;
              result.skins[place[own]].push_back({0.5 * (centre(at, voxel) + centre(beside, voxel)), d});
            }
  }
  return result;
}

} // namespace spherecut::topology
