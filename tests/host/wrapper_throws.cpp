/* Results of vrtm.hpp with exceptions: value() gives what the call gave, or throws what the result says. */

#include "check.h"
#include "vrtm.hpp"

#include <cstring>

namespace {

/* Expects that `call` throws this error, and that its message contains `text`. */
template <class Call> void throws(const char *what, vrtm::Code code, const char *text, Call call)
{
    try {
        call();
        check_that(0, what, "nothing was thrown");
    } catch (const vrtm::Error &error) {
        check_that(error.code() == code && std::strstr(error.what(), text) != nullptr, what, error.what());
    }
}

void values()
{
    const vrtm::Device device = vrtm::Device::create(vrtm::DeviceDesc().set(vrtm::Backend::cpu)).value();
    check_that(vrtm::Backend(device.info().value().backend) == vrtm::Backend::cpu, "the value of a temporary", "");
    vrtm::Result<vrtm_device_info> info = device.info();
    check_that(info.value().threads > 0, "the value of a result that stays", "");
    check_that(std::move(info).value().threads > 0, "the value of one that is moved from", "");
}

void errors()
{
    vrtm::DeviceDesc desc;
    desc.threads = 5000;
    throws("a temporary", vrtm::Code::invalid_argument, "threads", [&] { vrtm::Device::create(desc).value(); });
    throws("a result that stays", vrtm::Code::invalid_handle, "device", [] {
        const auto info = vrtm::Device().info();
        check_that(!info && info.code() == vrtm::Code::invalid_handle, "it is looked at first", info.message());
        info.value();
    });
    throws("one without a value", vrtm::Code::invalid_handle, "asset", [] { vrtm::Asset().cancel().value(); });
}

} // namespace

int main()
{
    try {
        values();
        errors();
    } catch (const vrtm::Error &error) {
        check_that(0, "no exception", error.what());
    }
    return finish();
}
