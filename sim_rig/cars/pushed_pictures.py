"""Pictures that come from elsewhere, as MJPEG over HTTP: `http://HOST:PORT/CAR`."""

from aiohttp import web

from onboard.hmi.feed import Feed
from sim_rig.cars.mjpeg_server import STREAM_TYPE, part


class PushedPictures:
    """Serves the pictures of one camera when they are pushed; a slow client misses some."""

    def __init__(self, car: str) -> None:
        """Serve the camera of `car`."""
        self.clients = 0
        """Streams that are open."""
        self._car = car
        self._feed: Feed[bytes] = Feed()

    async def start(self, host: str, port: int) -> int:
        """Listen, and return the port.

        Raises:
            OSError: the address cannot be used.
        """
        app = web.Application()
        app.router.add_get(f"/{self._car}", self._stream)
        self._runner = web.AppRunner(app, access_log=None, shutdown_timeout=0.2)
        await self._runner.setup()
        await web.TCPSite(self._runner, host, port).start()
        return int(self._runner.addresses[0][1])

    def push(self, jpeg: bytes) -> None:
        """Send a picture to all clients."""
        self._feed.publish(jpeg)

    async def close(self) -> None:
        """End all streams."""
        await self._runner.cleanup()

    async def _stream(self, request: web.Request) -> web.StreamResponse:
        response = web.StreamResponse(headers={"Content-Type": STREAM_TYPE})
        await response.prepare(request)
        self.clients += 1
        number = self._feed.number
        try:
            while True:
                number, jpeg = await self._feed.after(number)
                await response.write(part(jpeg))
        except ConnectionError:
            return response
        finally:
            self.clients -= 1
