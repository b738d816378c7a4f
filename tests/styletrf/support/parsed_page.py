"""An HTML page taken apart, and a text that would do harm if a page did not escape it."""

from html.parser import HTMLParser

HOSTILE = "</title><script>alert(1)</script>\"'><img src=x onerror=alert(2)> $body & ünï"


class Page(HTMLParser):
    """The text, the addresses and the tags of a page."""

    def __init__(self, text):
        super().__init__()
        self.addresses, self.tags, self.words, self.named = [], [], [], set()
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.named |= {name for name, _ in attributes}
        self.addresses += [v for k, v in attributes if k in ("src", "href", "poster")]

    def handle_data(self, data):
        self.words.append(data)

    @property
    def text(self):
        return " ".join(self.words)
