#include "walls/displays/web_server.h"

#include <fmt/format.h>

#include <array>
#include <boost/asio.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <chrono>
#include <list>
#include <optional>
#include <set>
#include <thread>
#include <utility>

#include "core/bytes.h"
#include "core/error.h"
#include "core/log.h"
#include "walls/displays/web_request.h"
#include "walls/link/socket.h"

namespace hpr {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using std::chrono::milliseconds;
using std::chrono::seconds;
template <typename Value>
using Task = asio::awaitable<Value>;
using Request = http::request<http::string_body>;
using Response = http::response<http::string_body>;

constexpr int kMaxConnections = 8;               ///< of those who know the token
constexpr std::size_t kMaxUnauthenticated = 32;  ///< connections that have not shown it
constexpr std::uint64_t kMaxBody_bytes = 4096;
constexpr std::uint32_t kMaxHeader_bytes = 8192;
constexpr seconds kToRead{10};  ///< a request, and between two of a connection
constexpr std::size_t kPiece_bytes = 65536;
constexpr seconds kBetweenParts{2};  ///< the longest: what does not change is sent again, which finds viewers that left
constexpr std::string_view kBoundary = "hpr-frame";

std::string_view view_of(beast::string_view text) {
  return {text.data(), text.size()};
}

/// "/path" and "query" of "/path?query".
std::pair<std::string_view, std::string_view> split_target(std::string_view target) {
  const std::size_t mark = target.find('?');
  if (mark == std::string_view::npos) return {target, {}};
  return {target.substr(0, mark), target.substr(mark + 1)};
}

Response answer(const Request& request, http::status status, std::string_view type, std::string body) {
  Response response(status, request.version());
  response.set(http::field::content_type, {type.data(), type.size()});
  response.set(http::field::cache_control, "no-store");
  response.set("X-Content-Type-Options", "nosniff");
  response.set("Referrer-Policy", "no-referrer");
  response.set(http::field::x_frame_options, "DENY");
  response.set("Cross-Origin-Resource-Policy", "same-origin");
  response.keep_alive(request.keep_alive());
  response.body() = std::move(body);
  response.prepare_payload();
  return response;
}

Response refusal(const Request& request, http::status status, const std::string& why) {
  Response response = answer(request, status, "text/plain; charset=utf-8", why + "\n");
  response.keep_alive(false);
  response.prepare_payload();
  return response;
}

void listen(tcp::acceptor& acceptor, const WebAddress& address) {
  boost::system::error_code error;
  const tcp::endpoint endpoint(asio::ip::make_address(address.host, error), address.port);
  if (!error) acceptor.open(endpoint.protocol(), error);
  if (!error) acceptor.set_option(asio::socket_base::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (!error) return;
  throw Error(ExitCode::Io,
              fmt::format("the web display cannot listen on {}:{}: {}", address.host, address.port, error.message()),
              "choose another port, or let hpr choose one with --display web");
}

/// Ends a coroutine that nobody waits for; logs what it threw.
void warn_of(const std::exception_ptr& failure) {
  try {
    if (failure) std::rethrow_exception(failure);
  } catch (const std::exception& error) {
    log::warning("the web display dropped a connection: {}", error.what());
  }
}

}  // namespace

class WebServer::Implementation {
 public:
  Implementation(WebHub& hub, const WebAddress& address, milliseconds to_write)
      : hub_(hub), address_(address), to_write_(to_write), token_(random_token()), acceptor_(io_) {
    listen(acceptor_, address);
    cookie_ = fmt::format("hpr-{}", acceptor_.local_endpoint().port());
    asio::co_spawn(io_, accept(), warn_of);
    thread_ = std::jthread([this] { io_.run(); });
  }

  ~Implementation() { io_.stop(); }
  Implementation(const Implementation&) = delete;
  Implementation& operator=(const Implementation&) = delete;

  [[nodiscard]] std::string url() const {
    const tcp::endpoint at = acceptor_.local_endpoint();
    const std::string host = at.address().is_unspecified() ? asio::ip::host_name() : address_.host;
    const bool six = host.find(':') != std::string::npos;
    return fmt::format("http://{}:{}/?token={}", six ? "[" + host + "]" : host, at.port(), token_);
  }

  void notify() {
    asio::post(io_, [this] {
      for (asio::steady_timer* const timer : waiting_) timer->cancel();
    });
  }

 private:
  /// One of the connections that are counted.
  class ConnectionSlot {
   public:
    explicit ConnectionSlot(int& used) : used_(used) { ++used_; }
    ConnectionSlot(const ConnectionSlot&) = delete;
    ConnectionSlot& operator=(const ConnectionSlot&) = delete;
    ~ConnectionSlot() { --used_; }

   private:
    int& used_;
  };

  /// A connection that has not shown the token.
  class Unauthenticated {
   public:
    Unauthenticated(std::list<beast::tcp_stream*>& all, beast::tcp_stream& stream)
        : all_(all), position_(all.insert(all.end(), &stream)) {}
    Unauthenticated(const Unauthenticated&) = delete;
    Unauthenticated& operator=(const Unauthenticated&) = delete;
    ~Unauthenticated() { all_.erase(position_); }

   private:
    std::list<beast::tcp_stream*>& all_;
    std::list<beast::tcp_stream*>::iterator position_;
  };

  /// Whoever has waited longest without the token makes room, so that strangers keep nobody out.
  void close_oldest_unauthenticated() {
    unauthenticated_.front()->close();  // its coroutine ends, later
    unauthenticated_.splice(unauthenticated_.end(), unauthenticated_, unauthenticated_.begin());
  }

  Task<void> accept() {
    while (true) {
      boost::system::error_code error;
      tcp::socket socket = co_await acceptor_.async_accept(asio::redirect_error(asio::use_awaitable, error));
      if (error) {  // e.g. no descriptors left
        asio::steady_timer pause(io_, milliseconds(100));
        co_await pause.async_wait(asio::redirect_error(asio::use_awaitable, error));
        continue;
      }
      socket.set_option(tcp::no_delay(true), error);
      beast::tcp_stream stream(std::move(socket));
      if (unauthenticated_.size() >= kMaxUnauthenticated) close_oldest_unauthenticated();
      asio::co_spawn(io_, serve(std::move(stream)), warn_of);
    }
  }

  /// Reads one request within its limits; false when the connection is to end, after an answer that says why.
  Task<bool> read(beast::tcp_stream& stream, beast::flat_buffer& buffer, Request& request) {
    http::request_parser<http::string_body> parser;
    parser.header_limit(kMaxHeader_bytes);
    parser.body_limit(kMaxBody_bytes);
    boost::system::error_code error;
    stream.expires_after(kToRead);
    co_await http::async_read(stream, buffer, parser, asio::redirect_error(asio::use_awaitable, error));
    request = parser.release();
    if (!error) co_return true;
    if (error == http::error::body_limit) {
      co_await end(stream, refusal(request, http::status::payload_too_large, "a request has at most 4 KiB"));
    } else if (error == http::error::header_limit || error == http::error::buffer_overflow) {
      co_await end(stream,
                   refusal(request, http::status::request_header_fields_too_large, "a header has at most 8 KiB"));
    } else if (error.category() == make_error_code(http::error::bad_target).category() &&
               error != http::error::end_of_stream && error != http::error::partial_message) {
      co_await end(stream, refusal(request, http::status::bad_request, "this is no HTTP request"));
    }
    co_return false;
  }

  Task<bool> write(beast::tcp_stream& stream, const Response& response) {
    boost::system::error_code error;
    stream.expires_after(to_write_);
    co_await http::async_write(stream, response, asio::redirect_error(asio::use_awaitable, error));
    co_return !error;
  }

  /// In pieces with a time limit each: whoever reads slowly gets all of it late, who reads nothing is let go.
  Task<bool> write_pieces(beast::tcp_stream& stream, asio::const_buffer bytes) {
    while (bytes.size() > 0) {
      const asio::const_buffer piece = asio::buffer(bytes, kPiece_bytes);
      boost::system::error_code error;
      stream.expires_after(to_write_);
      co_await asio::async_write(stream, piece, asio::redirect_error(asio::use_awaitable, error));
      if (error) co_return false;
      bytes += piece.size();
    }
    co_return true;
  }

  /// The last answer of a connection. What the other side still sends is taken, or the answer would be lost to a reset.
  Task<void> end(beast::tcp_stream& stream, Response response) {
    if (!co_await write(stream, response)) co_return;
    boost::system::error_code error;
    stream.socket().shutdown(tcp::socket::shutdown_send, error);
    std::array<char, 4096> scrap{};
    constexpr int kMaxReads = 16;
    stream.expires_after(seconds(1));
    for (int i = 0; i < kMaxReads && !error; ++i) {
      const auto buffer = asio::buffer(scrap);
      co_await stream.async_read_some(buffer, asio::redirect_error(asio::use_awaitable, error));
    }
  }

  Task<void> serve(beast::tcp_stream stream) {
    beast::flat_buffer buffer(kMaxHeader_bytes + kMaxBody_bytes);
    std::optional<Unauthenticated> unauthenticated(std::in_place, unauthenticated_, stream);
    std::optional<ConnectionSlot> slot;
    while (true) {
      Request request;
      if (!co_await read(stream, buffer, request)) co_return;
      if (!slot && has_key(request)) {
        if (connections_ == kMaxConnections) {
          Response response = refusal(request, http::status::service_unavailable, "eight connections are open already");
          response.set(http::field::retry_after, "5");
          co_await end(stream, std::move(response));
          co_return;
        }
        slot.emplace(connections_);
        unauthenticated.reset();
      }
      if (const auto which = stream_asked_for(request)) {
        co_await send_stream(stream, *which);
        co_return;
      }
      Response response = respond(request);
      if (response.keep_alive()) {
        if (!co_await write(stream, response)) co_return;
      } else {
        co_await end(stream, std::move(response));
        co_return;
      }
    }
  }

  /// Why the request is none of ours; empty: it is.
  [[nodiscard]] std::string_view objection(const Request& request) const {
    const std::string_view host = view_of(request[http::field::host]);
    if (!host_is_ours(host)) return "this name is not this machine's";
    const auto origin = request.find(http::field::origin);
    if (origin != request.end() && !origin_is_ours(view_of(origin->value()), host)) return "another site asked";
    return {};
  }

  [[nodiscard]] bool has_key(const Request& request) const {
    return same_token(cookie_in(view_of(request[http::field::cookie]), cookie_), token_);
  }

  [[nodiscard]] std::optional<std::size_t> stream_asked_for(const Request& request) const {
    if (request.method() != http::verb::get || !objection(request).empty() || !has_key(request)) return std::nullopt;
    const auto path = split_target(view_of(request.target())).first;
    constexpr std::string_view kOfScreen = "/stream/";
    if (path == "/stream") return 0;
    return path.starts_with(kOfScreen) ? hub_.stream_of(path.substr(kOfScreen.size())) : std::nullopt;
  }

  [[nodiscard]] Response respond(const Request& request) {
    if (const std::string_view why = objection(request); !why.empty()) {
      return refusal(request, http::status::forbidden, std::string(why));
    }
    const auto [path, query] = split_target(view_of(request.target()));
    constexpr std::string_view kToken = "token=";
    if (request.method() == http::verb::get && path == "/" && query.starts_with(kToken) &&
        same_token(query.substr(kToken.size()), token_)) {
      Response response = answer(request, http::status::see_other, "text/plain", "");
      response.set(http::field::location, "/");
      response.set(http::field::set_cookie, fmt::format("{}={}; HttpOnly; SameSite=Lax; Path=/", cookie_, token_));
      return response;
    }
    if (!has_key(request)) {
      return refusal(request, http::status::forbidden, "open the address that hpr printed, with its token");
    }
    if (path == "/camera") return move_camera(request);
    if (request.method() != http::verb::get) {
      return refusal(request, http::status::method_not_allowed, "only GET, and POST to /camera");
    }
    return page(request, path);
  }

  [[nodiscard]] Response move_camera(const Request& request) {
    if (request.method() != http::verb::post) {
      return refusal(request, http::status::method_not_allowed, "the camera is moved by POST");
    }
    // A form of another site cannot send this type.
    const bool typed = view_of(request[http::field::content_type]).starts_with("application/json");
    const auto motion = typed ? parse_motion(request.body()) : std::nullopt;
    if (!motion) return refusal(request, http::status::bad_request, "this is no motion of a camera");
    hub_.add(*motion);
    return answer(request, http::status::no_content, "text/plain", "");
  }

  [[nodiscard]] Response page(const Request& request, std::string_view path) {
    if (path == "/status") return answer(request, http::status::ok, "application/json", hub_.status());
    const Wall& wall = hub_.wall();
    WebPage page{.title = wall.name.empty() ? "hpr wall" : wall.name,
                 .stream = "/stream",
                 .wall_heights = 1.0,
                 .screens = {},
                 .nonce = random_token()};
    for (const WallScreen& screen : wall.screens) page.screens.push_back(screen.id);
    constexpr std::string_view kScreen = "/screen/";
    if (path.starts_with(kScreen)) {
      const std::string id(path.substr(kScreen.size()));
      const auto stream = hub_.stream_of(id);
      if (!stream) return refusal(request, http::status::not_found, "the wall has no such screen");
      page.title += " / " + id;
      page.stream += "/" + id;
      page.wall_heights = screen_height(wall.screens[*stream - 1]) / std::max(wall_extent(wall).height, 1e-9);
    } else if (path != "/") {
      return refusal(request, http::status::not_found, "there is nothing here");
    }
    Response response = answer(request, http::status::ok, "text/html; charset=utf-8", to_html(page));
    response.set("Content-Security-Policy",
                 fmt::format("default-src 'none'; img-src 'self'; connect-src 'self'; script-src 'nonce-{0}'; "
                             "style-src 'nonce-{0}'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
                             page.nonce));
    return response;
  }

  /// Whether there was a new frame within the time.
  Task<bool> wait_for_news() {
    asio::steady_timer timer(io_, kBetweenParts);
    waiting_.insert(&timer);
    boost::system::error_code error;
    co_await timer.async_wait(asio::redirect_error(asio::use_awaitable, error));
    waiting_.erase(&timer);
    co_return bool(error);  // cancelled
  }

  /// Motion JPEG. Whatever frame is newest when the viewer took the one before is its next.
  Task<void> send_stream(beast::tcp_stream& stream, std::size_t which) {
    std::string head = fmt::format(
        "HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary={0}\r\nCache-Control: no-store\r\n"
        "X-Content-Type-Options: nosniff\r\nCross-Origin-Resource-Policy: same-origin\r\nConnection: close\r\n\r\n"
        "--{0}\r\n",
        kBoundary);
    // A browser shows a part once it has seen what follows it: the boundary goes along.
    const std::string tail = fmt::format("\r\n--{}\r\n", kBoundary);
    std::shared_ptr<const WebPicture> last;
    while (true) {
      std::shared_ptr<const WebPicture> next = hub_.picture(which);
      if (next == last) {
        const bool news = co_await wait_for_news();
        // Before the first picture nothing is written whose failure would show it.
        if (next == nullptr && !news && has_left(stream.socket().native_handle())) co_return;
        if (news || next == nullptr) continue;
      }
      head += fmt::format("Content-Type: image/jpeg\r\nContent-Length: {}\r\nX-Frame: {}\r\n\r\n", next->jpeg.size(),
                          next->frame);
      if (!co_await write_pieces(stream, asio::buffer(head))) co_return;
      if (!co_await write_pieces(stream, asio::buffer(next->jpeg))) co_return;
      if (!co_await write_pieces(stream, asio::buffer(tail))) co_return;
      head.clear();
      last = std::move(next);
    }
  }

  WebHub& hub_;
  WebAddress address_;
  milliseconds to_write_;
  std::string token_;
  std::string cookie_;
  std::list<beast::tcp_stream*> unauthenticated_;  ///< the oldest first; outlives what io_ still has of them
  asio::io_context io_{1};
  int connections_ = 0;
  std::set<asio::steady_timer*> waiting_;  ///< of streams
  tcp::acceptor acceptor_;
  std::jthread thread_;  ///< last: it ends before what it uses
};

void check_listening(const WebAddress& address) {
  asio::io_context io;
  tcp::acceptor acceptor(io);
  listen(acceptor, address);
}

WebServer::WebServer(WebHub& hub, const WebAddress& address, milliseconds to_write)
    : implementation_(std::make_unique<Implementation>(hub, address, to_write)) {}

WebServer::~WebServer() = default;

std::string WebServer::url() const {
  return implementation_->url();
}

void WebServer::notify() {
  implementation_->notify();
}

}  // namespace hpr
