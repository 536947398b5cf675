#include "src/output/cut_output.hpp"
#include "src/output/run_output.hpp"
#include "src/output/tear_output.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <set>

using namespace spherecut;
using namespace spherecut::app;

namespace {

struct Row {
  double length = 0.125;
  Vector3 force{1, -2.5, 1e-12};
  bool is_closed = true;
  std::string reason = "the \"front\"\nhas gone";
  std::vector<double> volumes{0.5, 0.25};
};

constexpr Column<Row> columns[] = {
    {"length_m", "{:.3e}", [](const Row& row) -> Cell { return row.length; }},
    {"force_*_N", "{:.9g}", [](const Row& row) -> Cell { return row.force; }},
    {"closed", "", [](const Row& row) -> Cell { return row.is_closed; }},
    {"letters", "", [](const Row& row) -> Cell { return count(row.reason.size()); }},
    {"reason", "quoted", [](const Row& row) -> Cell { return row.reason; }},
    {"plain", "", [](const Row&) -> Cell { return std::string("updated"); }},
    {"volumes_m3", "{:.12g}", [](const Row& row) -> Cell { return row.volumes; }},
};

/// Names in a line, of which none is empty and none stands twice.
std::size_t distinct_names(const std::string& line) {
  std::set<std::string> names;
  std::size_t begin = 0, all = 0;
  while (begin < line.size()) {
    const std::size_t end = std::min(line.find_first_of(",\n", begin), line.size());
    CHECK(end > begin);
    names.insert(line.substr(begin, end - begin));
    ++all;
    begin = end + 1;
  }
  CHECK(names.size() == all);
  return all;
}

} // namespace

TEST_CASE("A table's lines are those of its columns") {
  const std::span<const Column<Row>> all(columns);
  CHECK(header_line(all) == "length_m,force_x_N,force_y_N,force_z_N,closed,letters,reason,plain,volumes_m3\n");
  // A quote in a text is doubled, and a line's end would end the row.
  CHECK(csv_line(all, Row{}) == "1.250e-01,1,-2.5,1e-12,1,20,\"the \"\"front\"\" has gone\",updated,0.5;0.25\n");
  CHECK(csv_line(all, Row{0, Vector3::Zero(), false, "", {}}) == "0.000e+00,0,0,0,0,0,\"\",updated,\n");
}

TEST_CASE("No column of a run's tables stands twice, and a law of finite strain has one more") {
  const std::size_t linear = distinct_names(header_line(force_columns(false)));
  CHECK(distinct_names(header_line(force_columns(true))) == linear + 1);
  CHECK(distinct_names(header_line(cut_columns())) > 30);
  CHECK(distinct_names(header_line(tear_columns())) > 30);
}
