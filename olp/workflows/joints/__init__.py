"""Programs on machines with rotary joints: the verbs that read them."""
