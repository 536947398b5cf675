#include "python/bindings/tables.hpp"

#include "src/output/cut_output.hpp"
#include "src/output/run_output.hpp"
#include "src/output/tear_output.hpp"

namespace spherecut::bindings {
namespace {

void put(py::dict& row, std::string_view name, const app::Cell& cell) {
  const auto* vector = std::get_if<Vector3>(&cell);
  for (int k = 0; vector != nullptr && k < 3; ++k)
    row[py::str(app::component_name(name, k))] = (*vector)[k];
  if (vector != nullptr)
    return;
  const py::str key{std::string(name)};
  if (const auto* list = std::get_if<std::vector<double>>(&cell))
    row[key] = owned(std::vector<double>(*list));
  else if (const auto* yes = std::get_if<bool>(&cell))
    row[key] = *yes;
  else if (const auto* count = std::get_if<std::int64_t>(&cell))
    row[key] = *count;
  else if (const auto* number = std::get_if<double>(&cell))
    row[key] = *number;
  else
    row[key] = std::get<std::string>(cell);
}

template <class Row>
py::dict dict_of(std::span<const app::Column<Row>> columns, const Row& row) {
  py::dict out;
  for (const app::Column<Row>& column : columns)
    put(out, column.name, column.value(row));
  return out;
}

} // namespace

py::dict force_row(const app::StepResult& result) {
  return dict_of(app::force_columns(false), result);
}

py::dict cut_row(double time, const app::CutReport& report) {
  return dict_of(app::cut_columns(), app::CutRow{time, report});
}

py::list tear_rows(const app::TearReport& report) {
  py::list rows;
  for (const app::TearRow& row : app::tear_rows(report))
    rows.append(dict_of(app::tear_columns(), row));
  return rows;
}

} // namespace spherecut::bindings
