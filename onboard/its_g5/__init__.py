"""ETSI ITS-G5: GeoNetworking and BTP headers, and what its messages say of vehicles."""
