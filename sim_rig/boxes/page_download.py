"""Copies the recording of a box from its page, over HTTP."""

import asyncio
from pathlib import Path
from typing import Any

import aiohttp

from onboard.errors import UserError
from sim_rig.boxes.settings import PageSettings


async def download(
    what: str, page: PageSettings, folder: Path, written_within_s: float, within_s: float
) -> None:
    """Copy the segments that the box has written lately.

    Args:
        what: the setting, for the error.
        page: address and token.
        folder: where to copy them to; it is made.
        written_within_s: age of the oldest segment, s.
        within_s: limit of the duration, s.

    Raises:
        UserError: the page cannot be read, or refuses.
    """
    address = f"{page.url.rstrip('/')}/recording"
    try:
        token = page.token_file.read_text(encoding="utf-8").strip()
        folder.mkdir(parents=True, exist_ok=True)
        async with aiohttp.ClientSession(
            headers={"Authorization": f"Bearer {token}"},
            timeout=aiohttp.ClientTimeout(total=within_s),
        ) as session:
            for segment in await (await _get(session, what, address)).json():
                if segment["age_s"] <= written_within_s:
                    answer = await _get(session, what, f"{address}/{segment['name']}")
                    await _save(answer, what, folder, segment["name"])
    except (OSError, aiohttp.ClientError) as error:
        raise UserError(f"{what}: {address}: {error}") from error
    except TimeoutError:
        raise UserError(f"{what}: {address}: not done after {within_s:g} s") from None
    except (KeyError, TypeError, ValueError) as error:
        raise UserError(f"{what}: {address}: no list of segments: {error!r}") from error


async def _get(session: aiohttp.ClientSession, what: str, address: str) -> aiohttp.ClientResponse:
    answer = await session.get(address, allow_redirects=False)
    if answer.status != 200:
        reason = (await answer.text()).strip()
        raise UserError(f"{what}: {address}: {answer.status} {reason}")
    return answer


async def _save(answer: aiohttp.ClientResponse, what: str, folder: Path, name: Any) -> None:
    """Write a segment into `folder`, and never elsewhere, whatever the box calls it."""
    path = folder / str(name)
    if path.parent != folder or path.suffix != ".mcap":
        raise UserError(f"{what}: {str(name)!r} is no name of a segment")
    with await asyncio.to_thread(path.open, "wb") as file:
        async for chunk in answer.content.iter_chunked(64 * 1024):
            file.write(chunk)
