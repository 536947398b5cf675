// Messages of viewers that are noise, or nearly messages: under AddressSanitizer, with the sources it needs alone.
#include "src/viewer/requests.hpp"

#include "topology/base/errors.hpp"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>

using namespace spherecut;
using namespace spherecut::app;

namespace {

constexpr std::array<std::string_view, 14> messages{
    R"({"type":"hello","version":1})",
    R"({"type":"credit","frames":2})",
    R"({"type":"take"})",
    R"({"type":"mode","mode":"blade"})",
    R"({"type":"pose","n":7,"position":[0.01,-0.02,0.03],"orientation":[0,0,0,1]})",
    R"({"type":"grip","closed":true})",
    R"({"type":"scenario","name":"liver_live.toml"})",
    R"({"type":"set","young_modulus":6000,"poisson_ratio":0.45,"method":"galerkin","sight":"enriched"})",
    R"({"type":"set","toughness":100,"fine_spacing":0.006,"coarse_spacing":0.04})",
    R"({"type":"overlays","colour":"von_mises","nodes":true,"stages":false,"pick":[0,0,0.05]})",
    R"({"type":"overlays","pick":12,"slice":{"point":[0,0,0],"normal":[0,1,0],"size":0.1,"count":64}})",
    R"({"type":"overlays","pick":null,"slice":null})",
    R"({"type":"record","on":true})",
    R"({"type":"replay","name":"session-1.recording"})"};

class Random {
 public:
  std::size_t below(std::size_t count) {
    state_ = state_ * 6364136223846793005U + 1442695040888963407U;
    return static_cast<std::size_t>(state_ >> 33U) % count;
  }

 private:
  std::uint64_t state_ = 1;
};

/// Whether every number that was read can be used.
bool usable(const Request& request) {
  if (!request.position.allFinite())
    return false;
  if (request.orientation && std::abs(request.orientation->norm() - 1) > 1e-9)
    return false;
  const auto& slice = request.overlays.slice;
  return !slice || !*slice ||
         (std::abs((*slice)->normal.norm() - 1) < 1e-9 && (*slice)->size > 0 && (*slice)->count >= 2);
}

} // namespace

TEST_CASE("A message that is damaged anywhere is read with numbers that can be used, or refused in words") {
  Random random;
  int read = 0;
  int refused = 0;
  for (int i = 0; i < 20'000; ++i) {
    std::string text(messages[random.below(messages.size())]);
    const std::size_t damage = random.below(5);
    for (std::size_t k = 0; k < damage; ++k) {
      const std::size_t at = random.below(text.size());
      switch (random.below(5)) {
      case 0:
        text[at] = static_cast<char>(random.below(256));
        break;
      case 1:
        text.erase(at, 1 + random.below(8));
        break;
      case 2:
        text.insert(at, std::string(1 + random.below(40), "[{\"9-e."[random.below(7)]));
        break;
      case 3:
        text.insert(at, text.substr(random.below(text.size()), random.below(30)));
        break;
      default:
        text.replace(at, 1, "1e308");
      }
      if (text.empty())
        text = " ";
    }
    try {
      const Request request = parse_request(text);
      CHECK(usable(request));
      ++read;
    } catch (const InputError& error) {
      CHECK(std::string_view(error.what()).size() > 5);
      ++refused;
    }
  }
  CHECK(read > 4000);
  CHECK(refused > 4000);
}
