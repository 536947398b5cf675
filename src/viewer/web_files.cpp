// What may be asked of the server: paths, hosts, origins. No network here.
#include "src/viewer/web_server.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

int hex(char c) {
  if (c >= '0' && c <= '9')
    return c - '0';
  if (c >= 'a' && c <= 'f')
    return c - 'a' + 10;
  if (c >= 'A' && c <= 'F')
    return c - 'A' + 10;
  return -1;
}

std::optional<std::string> decoded(std::string_view path) {
  std::string text;
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (path[i] != '%') {
      text += path[i];
      continue;
    }
    if (i + 2 >= path.size() || hex(path[i + 1]) < 0 || hex(path[i + 2]) < 0)
      return std::nullopt;
    text += static_cast<char>(16 * hex(path[i + 1]) + hex(path[i + 2]));
    i += 2;
  }
  return text;
}

bool safe_name(std::string_view name) {
  return !name.empty() && name.front() != '.' && std::all_of(name.begin(), name.end(), [](char c) {
    const auto code = static_cast<unsigned char>(c);
    return code >= 0x20 && code != 0x7f && c != '\\' && c != ':';
  });
}

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result)
    c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return result;
}

/// "name:port" apart; port 80 when there is none, brackets of IPv6 taken off. Empty name: not a host.
struct Authority {
  std::string name;
  int port = 80;
  bool numeric = false; // an IP address
};

Authority authority_of(std::string_view text) {
  Authority result;
  std::string_view port;
  if (!text.empty() && text.front() == '[') {
    const auto end = text.find(']');
    if (end == std::string_view::npos || (end + 1 < text.size() && text[end + 1] != ':'))
      return {};
    result.name = lower(text.substr(1, end - 1));
    result.numeric = true;
    port = end + 1 < text.size() ? text.substr(end + 2) : "80";
  } else {
    const auto colon = text.find(':');
    result.name = lower(text.substr(0, colon));
    port = colon == std::string_view::npos ? "80" : text.substr(colon + 1);
    result.numeric = !result.name.empty() && result.name.find_first_not_of("0123456789.") == std::string::npos;
  }
  if (port.empty() || port.size() > 5 || port.find_first_not_of("0123456789") != std::string_view::npos)
    return {};
  result.port = std::stoi(std::string(port));
  return result;
}

bool is_local(const Authority& host) {
  return host.name == "localhost" || host.name == "127.0.0.1" || host.name == "::1";
}

bool is_any(std::string_view address) {
  return address == "0.0.0.0" || address == "::";
}

} // namespace

std::optional<std::filesystem::path> file_below(const std::filesystem::path& folder, std::string_view path) {
  path = path.substr(0, std::min(path.find('?'), path.find('#')));
  const std::optional<std::string> text = decoded(path);
  if (!text || text->empty() || text->front() != '/')
    return std::nullopt;
  std::filesystem::path file = folder;
  std::string_view rest = std::string_view(*text).substr(1);
  if (rest.empty())
    rest = "index.html";
  while (!rest.empty()) {
    const auto slash = rest.find('/');
    const std::string_view name = rest.substr(0, slash);
    if (!safe_name(name))
      return std::nullopt;
    file /= std::string(name);
    if (slash == std::string_view::npos)
      break;
    rest = rest.substr(slash + 1);
    if (rest.empty())
      return std::nullopt;
  }
  std::error_code error;
  const std::filesystem::path real = std::filesystem::canonical(file, error);
  if (error)
    return std::nullopt;
  const std::filesystem::path root = std::filesystem::canonical(folder, error);
  if (error || std::mismatch(root.begin(), root.end(), real.begin(), real.end()).first != root.end() ||
      !std::filesystem::is_regular_file(real, error))
    return std::nullopt;
  return real;
}

std::string_view content_type(const std::filesystem::path& file) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 14> types{{
      {".html", "text/html; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".mjs", "text/javascript; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
      {".json", "application/json"},
      {".jsonl", "application/x-ndjson"},
      {".map", "application/json"},
      {".svg", "image/svg+xml"},
      {".png", "image/png"},
      {".jpg", "image/jpeg"},
      {".ico", "image/x-icon"},
      {".wasm", "application/wasm"},
      {".woff2", "font/woff2"},
      {".txt", "text/plain; charset=utf-8"},
  }};
  const std::string extension = lower(file.extension().string());
  for (const auto& [name, type] : types)
    if (name == extension)
      return type;
  return "application/octet-stream";
}

bool host_allowed(std::string_view host, std::string_view address, int port) {
  const Authority asked = authority_of(host);
  if (asked.name.empty() || asked.port != port)
    return false;
  return is_local(asked) || asked.name == address || (is_any(address) && asked.numeric);
}

bool origin_allowed(std::string_view origin, std::string_view host, std::string_view address, int port) {
  if (origin.empty())
    return true; // not a browser
  static constexpr std::string_view scheme = "http://";
  if (origin.substr(0, scheme.size()) != scheme)
    return false;
  const Authority from = authority_of(origin.substr(scheme.size()));
  if (from.name.empty() || from.port != port)
    return false;
  return is_local(from) || from.name == address || (is_any(address) && from.name == authority_of(host).name);
}

} // namespace spherecut::app
