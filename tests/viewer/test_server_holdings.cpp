// What clients that come, go, talk nonsense or do not listen leave behind in `spherecut serve`: nothing.
#include "tests/src/scenario_text.hpp"
#include "tests/support/served_program.hpp"
#include "tests/support/web_client.hpp"

#include <array>
#include <catch2/catch.hpp>
#include <chrono>
#include <cstdio>
#include <memory>
#include <thread>

using namespace spherecut::tests;

namespace {

/// Comes, is greeted, says something that ends it, or goes by itself.
void visit(int port, int number) {
  static const std::array<std::string, 7> last_words{"",
                                                     "\xff\xfe",
                                                     "{\"type\":\"pose\",\"n\":1}",
                                                     std::string(60'000, '['),
                                                     std::string("nonsense\0 of all kinds", 23),
                                                     "{\"type\":\"credit\",\"frames\":1e99}",
                                                     "{\"type\":\"hello\",\"version\":7}"};
  WebSocketClient client(port);
  REQUIRE(client.open());
  client.send("{\"type\":\"hello\",\"version\":1}");
  client.send("{\"type\":\"credit\",\"frames\":8}");
  const std::string& words = last_words.at(static_cast<std::size_t>(number) % last_words.size());
  if (words.empty())
    return;
  client.send(words);
  CHECK(client.wait_for_close());
}

/// Once those who have gone are forgotten.
Holdings settled(const ServedProgram& server, const Holdings& least) {
  Holdings now = server.holdings();
  for (int i = 0; i < 500 && (now.files > least.files || now.threads > least.threads); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    now = server.holdings();
  }
  return now;
}

} // namespace

TEST_CASE(
    "A thousand clients that come and go with nonsense, and one that never reads, leave no memory, file or thread "
    "behind") {
  const ServedProgram server(small_scenario);
  const Holdings start = server.holdings();
  for (int i = 0; i < 100; ++i) // what is made once
    visit(server.port(), i);
  const Holdings before = settled(server, start);
  WebSocketClient deaf(server.port());
  deaf.send("{\"type\":\"hello\",\"version\":1}");
  for (int i = 0; i < 50; ++i)
    deaf.send("{\"type\":\"credit\",\"frames\":8}");
  for (int i = 0; i < 1000; ++i) {
    visit(server.port(), i);
    if (i % 20 == 0)
      deaf.send("{\"type\":\"credit\",\"frames\":8}");
  }
  const Holdings with = settled(server, {before.files + 1, before.threads, 0});
  CHECK(with.files == before.files + 1); // the one that never reads
  CHECK(with.threads == before.threads);
  // 4 MB: a client that left 4 kB behind would show.
  CHECK(with.memory < before.memory + 4);
  std::printf("after 1000 clients: %d files and %d threads, %+.1f MB\n", with.files - before.files,
              with.threads - before.threads, with.memory - before.memory);
}
