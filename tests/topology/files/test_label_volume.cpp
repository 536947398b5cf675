// Label volumes: the same ball of voxels in each format, and its surface.
#include "tests/support/mesh_checks.hpp"
#include "tests/support/temporary_folder.hpp"
#include "topology/base/errors.hpp"
#include "topology/domain/domain.hpp"
#include "topology/files/label_volume.hpp"
#include "topology/organ/surface_check.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <fstream>
#include <numbers>
#include <zlib.h>

using namespace spherecut;
using namespace spherecut::topology;

namespace {

const std::array<int, 3> voxels{24, 20, 16};
const Vector3 millimetres(1, 1.2, 1.5); // steps
const Vector3 corner_mm(-12, 5, 100);   // place of the first voxel
const Vector3 middle_mm = corner_mm + Vector3(11.5, 11.4, 11.25);
constexpr double radius_mm = 8;

/// A ball of label 3; with `marks` two voxels of label 7 in a corner.
std::vector<std::uint8_t> ball_labels(bool marks = false) {
  std::vector<std::uint8_t> labels;
  for (int k = 0; k < voxels[2]; ++k)
    for (int j = 0; j < voxels[1]; ++j)
      for (int i = 0; i < voxels[0]; ++i) {
        const Vector3 x = corner_mm + millimetres.cwiseProduct(Vector3(i, j, k));
        labels.push_back((x - middle_mm).norm() < radius_mm ? 3 : marks && k == 0 && j == 0 && i < 2 ? 7 : 0);
      }
  return labels;
}

std::string bytes_of_labels(const std::vector<std::uint8_t>& labels, int width, bool big_endian) {
  std::string bytes;
  for (const std::uint8_t label : labels)
    for (int b = 0; b < width; ++b)
      bytes += (big_endian ? b == width - 1 : b == 0) ? static_cast<char>(label) : '\0';
  return bytes;
}

std::string packed_as(const std::string& bytes, int window) {
  z_stream stream{};
  REQUIRE(deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, window, 8, Z_DEFAULT_STRATEGY) == Z_OK);
  std::string out(deflateBound(&stream, bytes.size()) + 64, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  REQUIRE(deflate(&stream, Z_FINISH) == Z_STREAM_END);
  out.resize(out.size() - stream.avail_out);
  deflateEnd(&stream);
  return out;
}
std::string gzipped(const std::string& bytes) {
  return packed_as(bytes, 31);
}

std::string nrrd(const std::string& type, const std::string& encoding, const std::string& data,
                 const std::string& more = "") {
  return fmt::format(
             "NRRD0004\n# made here\ntype: {}\ndimension: 3\nsizes: {} {} {}\nspace directions: ({},0,0) (0,{},0) "
             "(0,0,{})\nspace origin: ({},{},{})\nencoding: {}\n{}key:=value\n\n",
             type, voxels[0], voxels[1], voxels[2], millimetres.x(), millimetres.y(), millimetres.z(), corner_mm.x(),
             corner_mm.y(), corner_mm.z(), encoding, more) +
         data;
}

std::string mha(const std::string& type, bool compressed, const std::string& data, const std::string& more = "") {
  return fmt::format("ObjectType = Image\nNDims = 3\nBinaryData = True\nCompressedData = {}\n{}Offset = {} {} {}\n"
                     "ElementSpacing = {} {} {}\nDimSize = {} {} {}\nElementType = {}\nElementDataFile = LOCAL\n",
                     compressed ? "True" : "False", more, corner_mm.x(), corner_mm.y(), corner_mm.z(), millimetres.x(),
                     millimetres.y(), millimetres.z(), voxels[0], voxels[1], voxels[2], type) +
         data;
}

std::string nifti(const std::string& data, std::int16_t type, int bits, bool by_rows, bool big_endian,
                  double unit_per_mm = 1, int unit_code = 2) {
  std::string bytes(352, '\0');
  const auto put = [&](std::size_t offset, auto value) {
    auto raw = std::bit_cast<std::array<char, sizeof(value)>>(value);
    if (big_endian)
      std::reverse(raw.begin(), raw.end());
    std::memcpy(bytes.data() + offset, raw.data(), raw.size());
  };
  put(0, std::int32_t{348});
  const std::array<std::int16_t, 5> dim{3, static_cast<std::int16_t>(voxels[0]), static_cast<std::int16_t>(voxels[1]),
                                        static_cast<std::int16_t>(voxels[2]), 1};
  for (std::size_t d = 0; d < dim.size(); ++d)
    put(40 + 2 * d, dim[d]);
  put(70, type);
  put(72, static_cast<std::int16_t>(bits));
  put(76, 1.0F);
  for (std::size_t d = 0; d < 3; ++d)
    put(80 + 4 * d, static_cast<float>(unit_per_mm * millimetres[static_cast<int>(d)]));
  put(108, 352.0F);
  bytes[123] = static_cast<char>(unit_code);
  put(by_rows ? 254 : 252, std::int16_t{1});
  for (std::size_t d = 0; d < 3; ++d) {
    const auto origin = static_cast<float>(unit_per_mm * corner_mm[static_cast<int>(d)]);
    put(268 + 4 * d, origin);
    put(280 + 16 * d + 4 * d, static_cast<float>(unit_per_mm * millimetres[static_cast<int>(d)]));
    put(280 + 16 * d + 12, origin);
  }
  std::memcpy(bytes.data() + 344, "n+1", 4);
  return bytes + data;
}

void save(const std::filesystem::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

void require_ball(const LabelVolume& volume) {
  CHECK(volume.size == voxels);
  CHECK((volume.axes - Matrix3((1e-3 * millimetres).asDiagonal())).norm() < 1e-9);
  CHECK((volume.origin - 1e-3 * corner_mm).norm() < 1e-8);
  const std::vector<std::uint8_t> labels = ball_labels();
  CHECK(std::equal(volume.labels.begin(), volume.labels.end(), labels.begin(), labels.end()));
}

} // namespace

TEST_CASE("One ball of labels is the same in every format", "[label_volume]") {
  const tests::TemporaryFolder folder;
  const std::string raw = bytes_of_labels(ball_labels(), 1, false);
  const std::string wide = bytes_of_labels(ball_labels(), 2, false), turned = bytes_of_labels(ball_labels(), 2, true);
  std::string words, floats;
  for (const std::uint8_t label : ball_labels()) {
    words += fmt::format("{} ", label);
    const auto bytes = std::bit_cast<std::array<char, 4>>(static_cast<float>(label));
    floats.append(bytes.data(), 4);
  }
  const std::vector<std::pair<std::string, std::string>> files = {
      {"raw.nrrd", nrrd("uchar", "raw", raw)},
      {"gzip.nrrd",
       nrrd("unsigned short", "gzip", gzipped(wide), "endian: little\nspace units: \"mm\" \"mm\" \"mm\"\n")},
      {"big.nrrd", nrrd("int16", "raw", turned, "endian: big\n")},
      {"text.NRRD", nrrd("int", "ascii", words)},
      {"float.nrrd", nrrd("float", "raw", floats, "endian: little\n")},
      {"raw.mha", mha("MET_UCHAR", false, raw)},
      {"zlib.mha", mha("MET_USHORT", true, packed_as(wide, 15), "CompressedDataSize = 100\n")},
      {"big.mha",
       mha("MET_SHORT", false, turned, "BinaryDataByteOrderMSB = True\nTransformMatrix = 1 0 0 0 1 0 0 0 1\n")},
      {"rows.nii", nifti(wide, 4, 16, true, false)},
      {"turned.nii", nifti(turned, 512, 16, false, true)},
      {"packed.nii.gz", gzipped(nifti(raw, 2, 8, false, false))},
      {"metres.nii", nifti(raw, 2, 8, true, false, 1e-3, 1)}};
  for (const auto& [name, bytes] : files) {
    INFO(name);
    save(folder.path() / name, bytes);
    REQUIRE(is_label_volume(folder.path() / name));
    const LabelVolume volume = read_label_volume(folder.path() / name);
    require_ball(volume);
    CHECK(volume.has_unit == (name == "gzip.nrrd" || (!name.ends_with("nrrd") && name != "text.NRRD")));
  }
  CHECK(read_label_volume(folder.path() / "raw.mha", 1.0).origin == corner_mm);
}

TEST_CASE("Damaged label volumes are refused in words, wherever they end", "[label_volume]") {
  const tests::TemporaryFolder folder;
  const std::string raw = bytes_of_labels(ball_labels(), 1, false);
  for (const auto& [name, bytes] : {std::pair<std::string, std::string>{"a.nrrd", nrrd("uchar", "gzip", gzipped(raw))},
                                    {"b.mha", mha("MET_UCHAR", true, packed_as(raw, 15))},
                                    {"c.nii", nifti(raw, 2, 8, true, false)},
                                    {"d.nii.gz", gzipped(nifti(raw, 2, 8, true, false))}}) {
    const auto file = folder.path() / name;
    for (std::size_t part = 1; part < 40; ++part) {
      save(file, bytes.substr(0, bytes.size() * part / 40));
      try { // of a packed file, what follows the last label may be missing
        const LabelVolume volume = read_label_volume(file);
        CHECK(part == 39);
        require_ball(volume);
      } catch (const InputError& error) {
        CHECK_THAT(error.what(), Catch::Contains(name));
      }
      std::string flipped = bytes;
      flipped[bytes.size() * part / 40] = static_cast<char>(flipped[bytes.size() * part / 40] ^ 0x2A);
      save(file, flipped);
      try {
        read_label_volume(file);
      } catch (const InputError& error) {
        CHECK_THAT(error.what(), Catch::Contains(name));
      }
    }
  }
  const auto refused = [&](const std::string& name, const std::string& bytes, const std::string& why) {
    save(folder.path() / name, bytes);
    CHECK_THROWS_WITH(read_label_volume(folder.path() / name), Catch::Contains(name) && Catch::Contains(why));
  };
  refused("a.nrrd", nrrd("uchar", "bzip2", raw), "allowed: raw, gzip, text");
  refused("a.nrrd", nrrd("block", "raw", raw), "'block'");
  refused("a.nrrd", "NRRD0004\ntype: uchar\ndimension: 4\nsizes: 3 2 2 2\nencoding: raw\n\n", "4 dimensions");
  refused("a.nrrd", nrrd("uchar", "raw", raw, "data file: labels.raw\n"), "another file");
  refused("a.mha", "NDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\nElementDataFile = a.raw\n", "one file");
  std::string image;
  for (std::size_t i = 0; i < ball_labels().size(); ++i)
    image += fmt::format("{} ", 0.37 * static_cast<double>(i));
  refused("a.nrrd", nrrd("float", "text", image), "Is this an image");
  refused("a.mha", mha("MET_UCHAR", false, raw.substr(1)), "cut short");
  std::string huge = mha("MET_UCHAR", false, raw);
  huge.replace(huge.find("DimSize = 24"), 12, "DimSize = 24000000");
  refused("a.mha", huge, "in all");
}

TEST_CASE("The surface of a label is smooth, closed, and keeps every voxel on its side", "[label_volume]") {
  const tests::TemporaryFolder folder;
  const auto file = folder.path() / "ball.mha";
  save(file, mha("MET_UCHAR", false, bytes_of_labels(ball_labels(), 1, false)));
  const LabelVolume volume = read_label_volume(file);
  const LabelSurface made = label_surface(volume, std::nullopt, "ball.mha");
  const CheckedSurface surface = check_surface(made.soup, "ball.mha");
  CHECK(surface.mended.empty());
  tests::require_closed_sphere(surface.mesh);
  const double exact = 4.0 / 3 * std::numbers::pi * std::pow(1e-3 * radius_mm, 3);
  CHECK(topology::volume(surface.mesh) == Approx(exact).epsilon(0.03));
  CHECK(area(surface.mesh) == Approx(4 * std::numbers::pi * std::pow(1e-3 * radius_mm, 2)).epsilon(0.06));
  const auto domain = make_organ_domain(surface.mesh);
  for (int k = 0, at = 0; k < voxels[2]; ++k)
    for (int j = 0; j < voxels[1]; ++j)
      for (int i = 0; i < voxels[0]; ++i, ++at)
        CHECK((domain->signed_distance(volume.origin + volume.axes * Vector3(i, j, k)) < 0) ==
              (volume.labels[at] == 3));
  REQUIRE(made.remarks.size() == 1);
  CHECK_THAT(made.remarks[0], Catch::Contains("label 3") && Catch::Contains("voxels of 1 x 1.2 x 1.5 mm"));
}

TEST_CASE("Which label is the organ is told, asked for, or refused", "[label_volume]") {
  const tests::TemporaryFolder folder;
  const auto file = folder.path() / "two.mha";
  save(file, mha("MET_UCHAR", false, bytes_of_labels(ball_labels(true), 1, false)));
  const LabelVolume volume = read_label_volume(file);
  CHECK_THROWS_WITH(label_surface(volume, std::nullopt, "two.mha"), Catch::Contains("two.mha") &&
                                                                        Catch::Contains("holds 2 labels: 3 (") &&
                                                                        Catch::Contains("organ.label"));
  CHECK_THROWS_WITH(label_surface(volume, 4, "two.mha"), Catch::Contains("no voxel has the label 4"));
  const LabelSurface mark = label_surface(volume, 7, "two.mha");
  const CheckedSurface surface = check_surface(mark.soup, "two.mha");
  CHECK(topology::volume(surface.mesh) > 0);
  CHECK(std::any_of(mark.remarks.begin(), mark.remarks.end(),
                    [](const std::string& remark) { return remark.find("border") != std::string::npos; }));
}

TEST_CASE("A wall of one voxel stays a wall", "[label_volume]") {
  constexpr int wide = 32;
  LabelVolume plate{{wide, wide, 5}, Vector3::Zero(), 1e-3 * Matrix3::Identity(), true, {}};
  for (int k = 0; k < 5; ++k)
    for (int j = 0; j < wide; ++j)
      for (int i = 0; i < wide; ++i)
        plate.labels.push_back(k == 2 && i > 0 && i < wide - 1 && j > 0 && j < wide - 1 ? 1 : 0);
  const CheckedSurface surface = check_surface(label_surface(plate, 1, "plate").soup, "plate");
  tests::require_closed_sphere(surface.mesh);
  CHECK(topology::volume(surface.mesh) == Approx((wide - 2) * (wide - 2) * 1e-9).epsilon(0.1));
  const auto domain = make_organ_domain(surface.mesh);
  const Vector3 middle(0.0155, 0.0155, 0.002);
  CHECK((domain->closest_surface_point(middle) - middle).norm() == Approx(5e-4).epsilon(0.05));
}
