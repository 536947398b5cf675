#include "src/output/figure.hpp"

#include "tests/support/temporary_folder.hpp"
#include "topology/base/errors.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <sstream>

using namespace spherecut;
using app::Figure;
using app::Series;
using app::SeriesStyle;
using app::Table;

namespace {

constexpr double missing_value = std::numeric_limits<double>::quiet_NaN();

std::string contents(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

unsigned big_endian(const std::string& bytes, std::size_t at) {
  unsigned value = 0;
  for (std::size_t i = 0; i < 4; ++i)
    value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

Figure two_lines() {
  Figure figure{"Force on the tool", "depth / mm", "force / N", false, false, {}, 640, 480};
  figure.series.push_back({"exact", {0, 1, 2, 3}, {0, 1, 2.8, 5.2}, SeriesStyle::lines});
  figure.series.push_back({"computed", {0, 1, 2, 3}, {0, 1.1, missing_value, 5.1}, SeriesStyle::lines_and_points});
  return figure;
}

/// Sets an environment variable for the life of the object.
class Environment {
 public:
  Environment(const char* name, const char* value) : name_(name), old_(std::getenv(name)) { setenv(name, value, 1); }
  ~Environment() { setenv(name_, old_.c_str(), 1); }
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;

 private:
  const char* name_;
  std::string old_;
};

/// The pixels differ between the two pictures (their bytes do).
bool differ(const Figure& a, const Figure& b, const std::filesystem::path& folder) {
  write_png(a, folder / "a.png");
  write_png(b, folder / "b.png");
  return contents(folder / "a.png") != contents(folder / "b.png");
}

} // namespace

TEST_CASE("A figure becomes a PNG picture of the asked size") {
  const tests::TemporaryFolder folder;
  write_png(two_lines(), folder.path() / "figure.png");
  const std::string bytes = contents(folder.path() / "figure.png");
  REQUIRE(bytes.size() > 2000);
  CHECK(bytes.substr(0, 8) == "\x89PNG\r\n\x1a\n");
  CHECK(bytes.substr(12, 4) == "IHDR");
  CHECK(big_endian(bytes, 16) == 640);
  CHECK(big_endian(bytes, 20) == 480);
}

TEST_CASE("Every part of a figure is drawn") {
  const tests::TemporaryFolder folder;
  const Figure base = two_lines();
  Figure other = base;
  CHECK_FALSE(differ(base, other, folder.path()));
  other.title = "Force";
  CHECK(differ(base, other, folder.path()));
  other = base;
  other.series[1].label = "measured";
  CHECK(differ(base, other, folder.path()));
  other = base;
  other.series[0].y[2] = 3.4;
  CHECK(differ(base, other, folder.path()));
  other = base;
  other.log_y = true;
  CHECK(differ(base, other, folder.path()));
  other = base;
  other.y_label = "force / mN";
  CHECK(differ(base, other, folder.path()));
}

TEST_CASE("Labels are drawn as they are and never run as commands") {
  const tests::TemporaryFolder folder;
  const std::filesystem::path trap = folder.path() / "trap";
  Figure figure = two_lines();
  figure.title = "'; system('touch " + trap.string() + "'); set title '";
  figure.x_label = "`touch " + trap.string() + "` $(touch " + trap.string() + ") \"quoted\" \\";
  figure.y_label = "first\nsystem 'touch " + trap.string() + "'";
  figure.series[0].label = "END_OF_DATA {/*9 big} @x_y ν = 0.3";
  write_png(figure, folder.path() / "it's a figure.png");
  CHECK(std::filesystem::exists(folder.path() / "it's a figure.png"));
  CHECK_FALSE(std::filesystem::exists(trap));
}

TEST_CASE("Points that cannot be drawn are left out, on logarithmic axes non-positive ones too") {
  const tests::TemporaryFolder folder;
  Figure figure = two_lines();
  figure.log_x = figure.log_y = true;
  figure.series[0] = {
      "holes", {-1, 0, 1, missing_value, 2, 3}, {1, 1, 0, 4, std::numeric_limits<double>::infinity(), 7}};
  CHECK_NOTHROW(write_png(figure, folder.path() / "holes.png"));
  figure.series = {{"one point", {1}, {2}}};
  CHECK_NOTHROW(write_png(figure, folder.path() / "one.png"));
  figure.series = {{"level", {1, 2}, {0, 0}}};
  figure.log_x = figure.log_y = false;
  CHECK_NOTHROW(write_png(figure, folder.path() / "level.png"));
  figure.series = {{"nothing", {missing_value}, {2}}};
  CHECK_THROWS_AS(write_png(figure, folder.path() / "nothing.png"), InputError);
}

TEST_CASE("A figure that cannot be written is refused with its file named") {
  const tests::TemporaryFolder folder;
  const std::filesystem::path missing = folder.path() / "missing" / "figure.png";
  CHECK_THROWS_WITH(write_png(two_lines(), missing), Catch::Contains(missing.string()));
  Figure uneven = two_lines();
  uneven.series[0].x.pop_back();
  CHECK_THROWS_WITH(write_png(uneven, folder.path() / "uneven.png"), Catch::Contains("'exact' has 3 x values and 4"));
  Figure tiny = two_lines();
  tiny.width = 3;
  CHECK_THROWS_AS(write_png(tiny, folder.path() / "tiny.png"), InputError);
  if (std::filesystem::exists("/dev/full"))
    CHECK_THROWS_AS(write_png(two_lines(), "/dev/full"), InputError);
}

TEST_CASE("A missing gnuplot is said so and leaves no file") {
  const tests::TemporaryFolder folder;
  const Environment path("PATH", folder.path().c_str());
  CHECK_THROWS_WITH(write_png(two_lines(), folder.path() / "figure.png"), Catch::Contains("gnuplot-nox"));
  CHECK_FALSE(std::filesystem::exists(folder.path() / "figure.png"));
}

TEST_CASE("A gnuplot that fails is reported with what it said") {
  const tests::TemporaryFolder folder;
  {
    std::ofstream fake(folder.path() / "gnuplot");
    fake << "#!/bin/sh\necho out of ink >&2\nexit 3\n";
  }
  std::filesystem::permissions(folder.path() / "gnuplot", std::filesystem::perms::owner_all);
  const Environment path("PATH", (folder.path().string() + ":" + std::getenv("PATH")).c_str());
  CHECK_THROWS_WITH(write_png(two_lines(), folder.path() / "figure.png"), Catch::Contains("out of ink"));
  CHECK_FALSE(std::filesystem::exists(folder.path() / "figure.png"));
}

TEST_CASE("A table reads back with its columns, nine digits and empty cells for what is missing") {
  const tests::TemporaryFolder folder;
  Table table({"time / s", "force / N", "note"});
  table.add(std::vector<double>{1.0 / 3, -2.5e-7, missing_value});
  table.add(std::vector<std::string>{"2", "", "said \"no, never\""});
  table.write(folder.path() / "table.csv");
  CHECK(contents(folder.path() / "table.csv") == "time / s,force / N,note\n"
                                                 "0.333333333,-2.5e-07,\n"
                                                 "2,,\"said \"\"no, never\"\"\"\n");
}

TEST_CASE("A table refuses rows of another length and files that cannot be written in full") {
  const tests::TemporaryFolder folder;
  Table table({"x", "y"});
  CHECK_THROWS_WITH(table.add(std::vector<double>{1}), Catch::Contains("1 cells (must be 2)"));
  CHECK_THROWS_AS(Table(std::vector<std::string>{}), InputError);
  table.add(std::vector<double>{1, 2});
  CHECK_THROWS_AS(table.write(folder.path() / "missing" / "table.csv"), InputError);
  if (std::filesystem::exists("/dev/full"))
    CHECK_THROWS_AS(table.write("/dev/full"), InputError);
}
