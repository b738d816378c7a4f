"""The webhook of a grid: `[grid] webhook` in `luigi.cfg` names an address that receives JSON.

The address is a secret, since whoever has it can post. So neither the address nor the text of an
error, which may quote it, is logged.
"""

import errno
import json
import logging
import os
import urllib.request
from collections.abc import Mapping
from http.client import HTTPException
from ssl import SSLError
from typing import Any
from urllib.error import HTTPError, URLError

from pipeline.settings import setting

_log = logging.getLogger("pipeline")


class _Unfollowed(urllib.request.HTTPRedirectHandler):
    """Follows no redirect: the request would become one without the body, and succeed."""

    def http_error_303(self, _request: object, response: Any, *_about: object) -> Any:
        """Returns the answer, which counts as success: the server has read the request."""
        return response

    def redirect_request(self, *_response: object) -> None:
        """Returns no request, so that the answer counts as a failure."""


def post_to_webhook(fields: Mapping[str, Any]) -> None:
    """Posts the fields as JSON if there is a webhook; if that fails, a warning is logged."""
    if not (address := _address()):
        return
    body = json.dumps(fields).encode()
    kind = {"Content-Type": "application/json"}
    try:
        request = urllib.request.Request(address, body, kind)  # noqa: S310  the user's own address
        urllib.request.build_opener(_Unfollowed).open(request, timeout=20).close()
    except (OSError, ValueError, HTTPException) as error:
        _log.warning("%s. Check the address in luigi.cfg.", _problem(error))


def _problem(error: Exception) -> str:
    if isinstance(error, HTTPError) and error.code // 100 == 3:
        answer = f"the server answered {error.code}, a redirect: it may not have the summary"
        return f"[grid] webhook: {answer}"
    return f"nothing was posted to [grid] webhook: {_without_address(error)}"


def _without_address(error: Exception) -> str:
    """Returns a failure by its status, number or type; never the text of an error."""
    match error:
        case HTTPError(code=code):
            return f"the server answered {code}"
        case URLError(reason=Exception() as reason):
            return _without_address(reason)
        case SSLError():
            return f"no secure connection ({type(error).__name__})"
        case OSError(errno=int(number)) if number in errno.errorcode:
            return os.strerror(number)
        case ValueError() | URLError():
            return "it is not a web address"
    return f"the answer is not HTTP ({type(error).__name__})"


def _address() -> str:
    """Returns the address in `[grid] webhook`, or in `[night] webhook` of earlier versions."""
    if address := setting("grid", "webhook"):
        return address
    if address := setting("night", "webhook"):
        _log.warning("luigi.cfg: rename the section [night] to [grid]; [night] will be ignored.")
    return address
