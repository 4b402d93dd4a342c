"""The 802.11p channel beside ns-3, and for the other studies."""
