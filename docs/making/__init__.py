"""Generated pages of the site: scenario keys, commands, the public interface, the gallery."""
