#include "src/model/rest_memo.hpp"

#include <bit>
#include <cstdint>
#include <utility>

namespace spherecut::app {
namespace {

constexpr std::size_t most_places = 1 << 16; // more are not of a blade that moves on

bool same(const VectorX& a, const VectorX& b) {
  return a.size() == b.size() && (a.array() == b.array()).all();
}

} // namespace

void RestMemo::turn_to(const solvers::Discretisation* body, const std::shared_ptr<const topology::Incision>& incision,
                       bool is_solved, const solvers::Field& field, double spacing) {
  if (found_.size() < most_places && spacing == spacing_ && body == body_ && incision == incision_ &&
      is_solved == is_solved_ &&
      (!is_solved || (field.load_factor == field_.load_factor && same(field.coefficients, field_.coefficients) &&
                      same(field.pressure, field_.pressure) && same(field.prescribed, field_.prescribed))))
    return;
  found_.clear();
  body_ = body;
  spacing_ = spacing;
  incision_ = incision;
  is_solved_ = is_solved;
  field_ = is_solved ? field : solvers::Field{};
}

const RestMemo::Found* RestMemo::find(const Vector3& x) const {
  const auto at = found_.find({x.x(), x.y(), x.z()});
  return at == found_.end() ? nullptr : &at->second;
}

const RestMemo::Found& RestMemo::keep(const Vector3& x, Found found) {
  return found_.insert_or_assign({x.x(), x.y(), x.z()}, std::move(found)).first->second;
}

std::size_t RestMemo::Hash::operator()(const Key& key) const {
  std::uint64_t hash = 0;
  for (const double x : key)
    hash = (hash ^ std::bit_cast<std::uint64_t>(x)) * 0x9E3779B97F4A7C15U; // Fibonacci hashing [Knuth 1998]
  return static_cast<std::size_t>(hash ^ (hash >> 32));
}

} // namespace spherecut::app
