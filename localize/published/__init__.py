"""The paper's methods, as the text states them and as the authors coded them."""
