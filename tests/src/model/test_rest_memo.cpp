#include "src/model/rest_memo.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <memory>

using namespace spherecut;
using app::RestMemo;

TEST_CASE("Places at rest are kept for one state of a body, and for no other", "[cut]") {
  const Vector3 x(0.01, -0.02, 0.03), rest(0.011, -0.021, 0.031);
  solvers::Field field;
  field.coefficients = VectorX::LinSpaced(6, 0, 1);
  field.prescribed = VectorX::Zero(3);
  RestMemo memo;
  const auto turn_to = [&](const solvers::Field& to, bool is_solved = true, double spacing = 0.004) {
    memo.turn_to(nullptr, nullptr, is_solved, to, spacing);
  };
  turn_to(field);
  CHECK(memo.find(x) == nullptr);
  CHECK(memo.keep(x, {rest}).rest == rest);
  CHECK(memo.keep(-x, {Vector3::Zero(), "no rest position"}).error == "no rest position");
  turn_to(field);
  REQUIRE(memo.find(x) != nullptr);
  CHECK(memo.find(x)->rest == rest);
  REQUIRE(memo.find(-x) != nullptr);
  CHECK_FALSE(memo.find(-x)->error.empty());
  CHECK(memo.find(x + Vector3(1e-17, 0, 0)) == nullptr); // another number

  solvers::Field other = field;
  SECTION("its coefficients") {
    other.coefficients[5] = std::nextafter(1.0, 2.0);
  }
  SECTION("what is prescribed") {
    other.prescribed[2] = 1e-3;
  }
  SECTION("its load") {
    other.load_factor = 0.5;
  }
  SECTION("its pressure") {
    other.pressure = VectorX::Zero(1);
  }
  turn_to(other);
  CHECK(memo.find(x) == nullptr);
  memo.keep(x, {rest});
  turn_to(other, false);
  CHECK(memo.find(x) == nullptr);
  memo.keep(x, {rest});
  turn_to(field, false); // the field does not count
  CHECK(memo.find(x) != nullptr);
  turn_to(field, false, 0.008);
  CHECK(memo.find(x) == nullptr);
}
