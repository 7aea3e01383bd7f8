# Links to files that are not part of the reference become plain text.
s|\[\([^]]*\)\](\.\./[^)]*)|\1|g
